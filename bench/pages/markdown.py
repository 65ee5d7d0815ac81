"""Tables, lists and numbers in Markdown."""
import textwrap

WIDTH = 120


def ms(value):
    return f"{value:.3f}" if value < 0.1 else f"{value:.2f}" if value < 100 else f"{value:.0f}"


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def bullets(lines):
    return "\n".join(f"- {line}" for line in lines) or "None."


def wrapped(page):
    """The page with its paragraphs and list items filled to WIDTH columns; tables, pictures, headings and code stay."""
    out, item, code = [], [], False

    def close():
        if item:
            indent = "  " if item[0].startswith("- ") else ""
            out.append(textwrap.fill(" ".join(item), WIDTH, subsequent_indent=indent, break_long_words=False,
                                     break_on_hyphens=False))
            item.clear()

    for line in page.split("\n"):
        code ^= line.startswith("```")
        if code or not line or line.startswith(("```", "|", "#", "<", "![")):
            close()
            out.append(line)
        else:
            if line.startswith("- "):
                close()
            item.append(line.strip())
    close()
    return "\n".join(out)
