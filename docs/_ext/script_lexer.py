"""Colours for blocks of the script language (```karamelo)."""

from __future__ import annotations

from pygments.lexer import RegexLexer, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text

from karamelo_py.language import registry


class ScriptLexer(RegexLexer):
    """Commands, numbers, texts, comments."""

    name = "karamelo"
    aliases = ("karamelo",)
    filenames = ("in.*",)
    tokens = {  # noqa: RUF012
        "root": [
            (r"#.*", Comment),
            (r'"[^"\n]*"', String),
            (words(registry.names("command"), prefix=r"\b", suffix=r"\b(?=\s*\(|$)"), Keyword),
            (r"[^\W\d][\w/-]*(?=\()", Name.Function),
            (r"\b(NULL|INF|EDGE|PI|all|true|false)\b", Name.Constant),
            (r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", Number),
            (r"[^\W\d]\w*", Name),
            (r"[-+*/^<>=!&|%]+", Operator),
            (r"[(),.]", Punctuation),
            (r"\s+|.", Text),
        ]
    }


def setup(app):
    """Make the lexer known to Sphinx."""
    app.add_lexer("karamelo", ScriptLexer)
    return {"parallel_read_safe": True}
