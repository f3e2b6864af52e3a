"""The one door for files: opened, measured and parsed here, and nowhere else.

Whatever a file holds, its size is known before anything is built from it, no code in it runs, and
what cannot be read is a ContentsError or an OSError. Schemas and arrays are checked by the callers.
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
