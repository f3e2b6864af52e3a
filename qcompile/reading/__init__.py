"""Reading files safely: every file is opened, measured and parsed in this package.

The size of a file is known before anything is built from it, no code in it runs, and a file that
cannot be read raises ContentsError or OSError. The callers check schemas and arrays.
"""

from qcompile.reading.arrays import read_npy, read_table
from qcompile.reading.files import ContentsError, read_file
from qcompile.reading.text import check_json, decode, load_json, read_json
from qcompile.reading.toml import read_toml
from qcompile.reading.torch_files import CodeError, read_torch

__all__ = [
    "CodeError",
    "ContentsError",
    "check_json",
    "decode",
    "load_json",
    "read_file",
    "read_json",
    "read_npy",
    "read_table",
    "read_toml",
    "read_torch",
]
