"""rust_source.py: as much of Rust's syntax as the scripts need: code without comments and strings, tests, functions."""

import re


def blanked(text, keep_strings=False):
    """Returns the text with comments, strings and characters blanked out; offsets are unchanged."""
    out, at = list(text), 0
    pattern = re.compile(
        r'//[^\n]*|/\*.*?\*/|b?r(#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?\'(?:\\[^\n]{1,8}?|[^\\\'\n])\'', re.S)
    while match := pattern.search(text, at):
        at = match.end()
        if keep_strings and not match[0].startswith("/"):
            continue
        for place in range(match.start(), match.end()):
            if text[place] != "\n":
                out[place] = " "
    return "".join(out)


def closing(text, at):
    """Returns the index of the brace that closes the one at `at`."""
    depth = 0
    for place in range(at, len(text)):
        if text[place] == "{":
            depth += 1
        elif text[place] == "}":
            depth -= 1
            if depth == 0:
                return place
    return len(text) - 1


def tests(code):
    """Returns the spans, and the files, compiled only for tests."""
    spans, files = [], set()
    for match in re.finditer(r"#\[cfg\((?:test|(?:any|all)\(test, feature =\s*\))\)\]\s*(?:pub(?:\([^)]*\))? )?(mod (\w+) *([;{])|[^;{]*([;{]))", code):
        if match[3] == ";":
            files.add(match[2])
        elif code[match.end() - 1] == "{":
            spans.append((match.start(), closing(code, match.end() - 1)))
    return spans, files


def functions(code, skipped):
    """(start of the body, its end, signature) of every function that is not skipped."""
    found = []
    for match in re.finditer(r"\bfn (\w+)", code):
        if any(low <= match.start() <= high for low, high in skipped):
            continue
        depth, at = 0, match.end()
        while at < len(code):
            if code[at] in "([":
                depth += 1
            elif code[at] in ")]":
                depth -= 1
            elif depth == 0 and code[at] in "{;":
                break
            at += 1
        if at < len(code) and code[at] == "{":
            found.append((at, closing(code, at), code[match.start():at]))
    return found


def test_files(file):
    """Returns the paths at which the modules may lie that a file declares only for tests."""
    _, names = tests(blanked(file.read_text()))
    return {folder / name for folder in (file.parent, file.with_suffix("")) for name in
            [name + ".rs" for name in names] + [name + "/mod.rs" for name in names]}
