"""What people look at: tables, progress, films."""
