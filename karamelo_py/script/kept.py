"""Parsers on disk: Lark needs 0.06 s to make those of the two grammars, and 0.01 s to read them."""

import hashlib
import io
import platform
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from karamelo_py.compiler import cache

if TYPE_CHECKING:
    from lark import Lark


def kept_parser(name: str, grammar: str, make: Callable[[], "Lark"]) -> "Lark":
    """A parser of a grammar, as `make` makes it, which is only called where there is no file.

    A file that cannot be read is written anew, and one that cannot be written is no matter.
    """
    import lark

    versions = f"{lark.__version__} {platform.python_version()}"
    digest = hashlib.sha256(f"{versions} {grammar}".encode()).hexdigest()[:24]
    path = cache.folder().with_name("parsers") / f"{name}-{digest}.parser"
    with suppress(Exception):  # a name in it may be one of another state of the sources
        content = path.read_bytes()
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            return lark.Lark.load(io.BytesIO(content[32:]))
    parser = make()
    file = io.BytesIO()
    parser.save(file)
    content = file.getvalue()
    with suppress(OSError):
        cache.write(path, hashlib.sha256(content).digest() + content)
    return parser
