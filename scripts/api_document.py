#!/usr/bin/env python3
"""Writes the API reference from the public C headers, whose comments are the documentation.

Usage: api_document.py [-o docs/api.md] [--check]

Reads engine/include/dcloth/*.h and engine/abi.json. A block of a header, up to an empty line, is one comment and the
declarations that it is about; it becomes one section. Fails where a name of the manifest got no section, or a function
lacks one of the lines Memory, Thread, Errors and Cost. --check writes nothing: it fails where the file is not up to
date.
"""
import argparse
import json
import os
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADERS = ["dcloth.h", "dcloth_fit.h", "dcloth_scene.h"]
CONTRACT = ["Memory", "Thread", "Errors", "Cost"]
DECLARATION = re.compile(r"""
  (?P<define>^\#define\ (?P<defined>DCLOTH_\w+)\ +\d+$)
  | ^enum\ \{(?P<enum>.*?)\n\};
  | ^typedef\ struct\ (?P<struct>\w+)\ \{(?P<fields>.*?)\n\}\ \w+;
  | ^typedef\ struct\ (?P<opaque>\w+)\ \w+;(?:\ */\*(?P<opaque_text>.*?)\*/)?
  | ^typedef\ \w+\ (?P<alias>\w+);
  | ^DCLOTH_API\ (?P<function>.*?;)
""", re.DOTALL | re.MULTILINE | re.VERBOSE)


def comment_lines(comment):
    """Of a whole comment, without its stars; the indentation behind them stays."""
    body = re.sub(r"^/\*+|\*/$", "", comment.strip())
    return [re.sub(r"^\s*\* ?", "", line).rstrip() for line in body.split("\n")]


def blocks(text):
    """(comment or None, declarations' text) of each block."""
    text = re.sub(r"^#ifdef __cplusplus.*?^#endif\n", "", text, flags=re.DOTALL | re.MULTILINE)
    kept = {}

    def keep(match):
        kept[f"\0{len(kept)}\0"] = match[0]
        return f"\0{len(kept) - 1}\0"

    # Comments may hold empty lines; they come back after the split.
    folded = re.sub(r"/\*.*?\*/", keep, text, flags=re.DOTALL)
    for block in re.split(r"\n\s*\n", folded):
        first = re.match(r"\s*(\0\d+\0)[ \t]*\n?", block)
        comment = kept[first[1]] if first else None
        rest = block[first.end():] if first else block
        yield comment, re.sub("\0\\d+\0", lambda m: kept[m[0]], rest).strip("\n")


def members(body, pattern):
    """(match, comment) of each member; a comment on the same line, else the one before it."""
    found, before, at = [], "", 0
    for token in re.finditer(r"/\*.*?\*/|" + pattern, body, re.DOTALL | re.VERBOSE):
        if not token[0].startswith("/*"):
            found.append([token, before])
            before = ""
        elif found and "\n" not in body[at:token.start()]:
            found[-1][1] = " ".join(" ".join(comment_lines(token[0])).split())
        else:
            before = " ".join(" ".join(comment_lines(token[0])).split())
        at = token.end()
    return found


class Page:
    def __init__(self, headers, manifest):
        self.headers, self.manifest = headers, manifest
        self.anchors = {}   # name -> section
        self.covered = set()
        self.faults = []

    def sections(self, header):
        for comment, text in blocks(self.headers[header]):
            declarations = list(DECLARATION.finditer(text))
            if declarations:
                title, names = self.name(declarations)
                self.anchors.update(dict.fromkeys(names, title))
                self.covered.update(names)
                yield title, comment, declarations

    def name(self, declarations):
        constants, types, functions = [], [], []
        for d in declarations:
            if d["define"]:
                constants.append(d["defined"])
            elif d["enum"]:
                constants += [m[0][1] for m in members(d["enum"], r"\b(DCLOTH_\w+)(?=[\s=,]|$)")]
            elif d["function"]:
                functions.append(re.search(r"(\w+)\s*\(", d["function"])[1])
            else:
                types.append(d["struct"] or d["opaque"] or d["alias"])
        title = (functions + types + [""])[0]
        if len(constants) == 1 and not title:
            title = constants[0]
        elif not title:
            title = os.path.commonprefix(constants).rpartition("_")[0]
        return title, constants + types + functions

    def prose(self, text):
        """One line of Markdown: names become links, stars and brackets stay what they are."""
        parts = text.split("`")
        for i, part in enumerate(parts):
            if i % 2:
                parts[i] = f"`{part}`"
                continue
            part = part.replace("<", "&lt;").replace("|", "\\|")
            parts[i] = re.sub(r"(?<!\w)(\*\w+|(?:dcloth|DCLOTH)_\w+(?:\*|\.\w+)?)", self.link, part)
        return "".join(parts)

    def link(self, match):
        word = match[1]
        if word in self.headers:
            return f"[`{word}`](#{word.replace('.', '')})"
        name = re.sub(r"\.\w+$", "", word)
        target = self.anchors.get(name)
        if target is None and name.endswith("_*"):  # a family of constants
            family = {title for known, title in self.anchors.items() if known.startswith(name[:-1])}
            target = family.pop() if len(family) == 1 else None
        return f"[`{word}`](#{target.lower()})" if target else f"`{word}`"

    def text(self, lines, parameters=()):
        """Paragraphs; a line followed by indented ones is an item, lines that begin with one of `parameters` are a list
        of them, other aligned columns stay as they are."""
        out, i = [], 0
        while i < len(lines):
            line = lines[i]
            if line.startswith("  ") and line.split()[0] in parameters:
                rows = []
                while i < len(lines) and lines[i].startswith("  "):
                    name, text = re.match(r"  (?: +|(\w+) +)(.*)", lines[i]).groups()
                    rows.append([name, text]) if name else rows[-1].append(text)
                    i += 1
                out += ["", *(f"- `{name}`: {self.prose(' '.join(text))}" for name, *text in rows), ""]
                continue
            item = [line.strip()]
            if re.match(r" +\S.*\S {2,}\S", line):
                table = []
                while i < len(lines) and lines[i].startswith(" "):
                    table.append(lines[i])
                    i += 1
                out += ["", "```", *(row[2:] for row in table), "```", ""]
                continue
            while (i + 1 < len(lines) and re.match(r" +\S", lines[i + 1])
                   and not re.match(r" +\S.*\S {2,}\S", lines[i + 1])):
                i += 1
                item.append(lines[i].strip())
            i += 1
            if len(item) > 1:
                if out and not out[-1].startswith("- "):
                    out.append("")
                out.append("- " + self.prose(" ".join(item)))
            elif out and out[-1].startswith("- ") and line:
                out += ["", self.prose(line)]
            else:
                out.append(self.prose(line))
        return re.sub(r"\n{3,}", "\n\n", "\n".join(out)).strip().split("\n")

    def table(self, head, rows):
        if any(len(re.sub(r"\]\(.*?\)", "", row[-1])) > 200 for row in rows):  # too wide for a cell
            return [*(f"- {name} {'= ' + kind if kind.isdigit() else f'({kind})'}" + (f": {text}" if text else "")
                      for name, kind, text in rows), ""]
        if any(row[-1] for row in rows):
            lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
            return lines + [f"| {' | '.join(row)} |".replace("|  |", "| |") for row in rows] + [""]
        return [f"| {' | '.join(head[:-1])} |", "|---" * (len(head) - 1) + "|",
                *(f"| {' | '.join(row[:-1])} |" for row in rows), ""]

    def declaration(self, d):
        if d["define"]:
            return [f"`{d['defined']}` = {self.manifest['constants'][d['defined']]}", ""]
        if d["enum"]:
            rows = [(f"`{m[1]}`", str(self.manifest["constants"][m[1]]), self.prose(text))
                    for m, text in members(d["enum"], r"\b(DCLOTH_\w+)(?=[\s=,]|$)")]
            return self.table(("constant", "value", "meaning"), rows)
        if d["struct"]:
            known = self.manifest["structs"][d["struct"]]
            fields = members(d["fields"], r"[^;/*\s][^;]*?;")
            found = [re.search(r"(\w+)(?:\[\w+\]|\)\(.*\))?;$", match[0])[1] for match, _ in fields]
            expected = [field["name"] for field in known["fields"]]
            if found != expected:
                self.faults.append(f"{d['struct']}: fields {', '.join(found)}; in the manifest {', '.join(expected)}")
            rows = [(f"`{field['name']}`", f"`{field['type']}`", self.prose(text))
                    for field, (_, text) in zip(known["fields"], fields)]
            return ([f"`struct {d['struct']}`, {known['bytes']} bytes where a pointer has 8:", ""] +
                    self.table(("field", "type", "meaning"), rows))
        if d["opaque"]:
            return [f"`{d['opaque']}`: {self.prose((d['opaque_text'] or 'opaque').strip())}", ""]
        if d["alias"]:
            return [f"`{d[0]}`", ""]
        return ["```c", re.sub(r"\n +", "\n    ", d["function"]), "```", ""]

    def section(self, title, comment, declarations):
        lines = comment_lines(comment) if comment else []
        functions = [d for d in declarations if d["function"]]
        contract = []
        if functions:
            whole = "\n".join(lines)
            found = re.search(r"(?:^|\s)" + r"\s".join(rf"{word}:\s(?P<{word}>.*)" for word in CONTRACT) + "$", whole,
                              re.DOTALL)
            if found:
                lines = whole[:found.start()].split("\n")
                contract = ["| | |", "|---|---|",
                            *(f"| {word} | {self.prose(' '.join(found[word].split()).rstrip('.'))} |"
                              for word in CONTRACT), ""]
            else:
                self.faults.append(f"{title}: the comment does not end in {', '.join(word + ':' for word in CONTRACT)}")
        out = [f"### {title}", ""]
        for d in functions:
            out += self.declaration(d)
        if lines:
            parameters = {word for d in functions for word in re.findall(r"(\w+)(?=[,)])", d["function"])}
            out += [*self.text(lines, parameters), ""]
        for d in declarations:
            if not d["function"]:
                out += self.declaration(d)
        return out + contract

    def write(self):
        sections = {header: list(self.sections(header)) for header in self.headers}
        out = ["# API reference", "",
               "Made by `scripts/api_document.py` from the headers, which say the same; a test compares. Not edited by "
               "hand.",
               "In which order to call what: [integrate.md](integrate.md). "
              "What may change: [compatibility.md](compatibility.md).", ""]
        for header, found in sections.items():
            out += [f"| [`{header}`](#{header.replace('.', '')}) | |", "|---|---|"]
            for title, comment, declarations in found:
                if any(d["function"] for d in declarations):
                    last = "\n".join(comment_lines(comment)).split("\n\n")[-1]
                    sentence = re.match(r"(.*?)[.:;](?=\s|$)", " ".join(last.split()))[1]
                    out.append(f"| [`{title}`](#{title}) | {self.prose(sentence)} |")
            out.append("")
        for header, found in sections.items():
            opening = re.match(r"/\*.*?\*/", self.headers[header], re.DOTALL)[0]
            out += ["", f"## {header}", "", *self.text(comment_lines(opening)), ""]
            for section in found:
                out += self.section(*section)
        wanted = {*self.manifest["functions"], *self.manifest["structs"], *self.manifest["constants"]}
        self.faults += [f"{name}: no section" for name in sorted(wanted - self.covered)]
        return self.wrapped(re.sub(r"\n{3,}", "\n\n", "\n".join(out)).rstrip()) + "\n"

    def wrapped(self, page):
        out, code = [], False
        for line in page.split("\n"):
            code ^= line.startswith("```")
            if code or line.startswith("|"):
                out.append(line)
            else:
                out += textwrap.wrap(line, 120, subsequent_indent="  " if line.startswith("- ") else "",
                                     break_long_words=False, break_on_hyphens=False) or [""]
        return "\n".join(out)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs/api.md")
    parser.add_argument("--include", type=Path, default=ROOT / "engine/include/dcloth", help="folder of the headers")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args(arguments)
    manifest = json.loads((ROOT / "engine/abi.json").read_text(encoding="utf-8"))
    page = Page({name: (options.include / name).read_text(encoding="utf-8") for name in HEADERS}, manifest)
    written = page.write()
    faults = page.faults
    if options.check and (not options.output.exists() or options.output.read_text(encoding="utf-8") != written):
        faults.append(f"{options.output} is not what the headers say; mend: scripts/api_document.py")
    for fault in faults:
        print(f"error: {fault}", file=sys.stderr)
    if faults:
        return 1
    if not options.check:
        options.output.write_text(written, encoding="utf-8")
    print(f"{options.output}: {len(page.covered)} names of {', '.join(HEADERS)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
