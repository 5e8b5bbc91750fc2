"""Parses XML with each element's line and place in the file, so that a single value can be replaced.

In OpenSim files returned to the user, everything that Kinertia did not estimate is unchanged, byte for byte; this rules
out parsing and writing them again.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

_DEEPEST = 200
"""Elements within elements; OpenSim's files have some twenty."""
_START_TAG = re.compile(rb"""<[^\s/>]+(?:[^>"']|"[^"]*"|'[^']*')*>""")


class XmlError(ValueError):
    """Error for a text that is not XML as used here; `line` is one-based."""

    def __init__(self, problem: str, line: int) -> None:
        self.line = line
        super().__init__(problem)


@dataclass(eq=False)
class Element:
    """One XML element.

    Attributes:
        tag, attributes: as in the file.
        line: one-based, of the start tag.
        outer: byte span from the start tag to the end of the end tag.
        inner: byte span of the content; None where the element is closed in its start tag.
        text: characters directly inside, without comments.
        children: elements directly inside.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    outer: tuple[int, int]
    inner: tuple[int, int] | None
    text: str = ""
    children: list[Element] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Attribute `name`, or empty."""
        return self.attributes.get("name", "")

    def child(self, *tags: str) -> Element | None:
        """Return the first child with one of these tags."""
        return next((child for child in self.children if child.tag in tags), None)

    def all(self, *tags: str) -> Iterator[Element]:
        """Yield all descendants with one of these tags, or all, however deep, in the order of the file."""
        for child in self.children:
            if not tags or child.tag in tags:
                yield child
            yield from child.all(*tags)


def parse(content: bytes) -> Element:
    """Parse the text and return the outermost element.

    Raises:
        XmlError: the text is not XML, is in an unknown encoding, or nests elements too deeply.
    """
    parser = expat.ParserCreate()
    top = Element("", {}, 0, (0, 0), None)
    stack = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > _DEEPEST:
            raise XmlError(f"more than {_DEEPEST} levels of nested elements", parser.CurrentLineNumber)
        at = parser.CurrentByteIndex
        match = _START_TAG.match(content, at)
        end = match.end() if match else at
        inner = None if content[end - 2 : end] == b"/>" else (end, end)
        element = Element(tag, attributes, parser.CurrentLineNumber, (at, end), inner)
        stack[-1].children.append(element)
        stack.append(element)

    def finish(tag: str) -> None:
        element = stack.pop()
        if element.inner is not None:
            at = parser.CurrentByteIndex
            element.inner = (element.inner[0], at)
            element.outer = (element.outer[0], content.index(b">", at) + 1)

    def characters(text: str) -> None:
        stack[-1].text += text

    parser.StartElementHandler, parser.EndElementHandler = start, finish
    parser.CharacterDataHandler = characters
    parser.buffer_text = True
    try:
        parser.Parse(content, True)
    except XmlError:
        raise
    except expat.ExpatError as error:
        raise XmlError(str(error), error.lineno) from None
    except (LookupError, ValueError) as error:  # what Python's codecs say
        raise XmlError(f"{error}; save it as UTF-8", 1) from None
    return top.children[0]


def replaced(content: bytes, changes: list[tuple[tuple[int, int], bytes]]) -> bytes:
    """Return the content with these byte spans replaced; spans do not overlap."""
    for (start, end), new in sorted(changes, reverse=True):
        content = content[:start] + new + content[end:]
    return content
