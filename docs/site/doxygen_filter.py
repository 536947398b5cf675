"""Makes the comments of a header those of Doxygen: doxygen_filter.py HEADER

The comment that the header begins with becomes the file's; a comment behind a member that of the member. Comments that
have three slashes are taken as they are. Text is text: what Doxygen would take for commands or tags is escaped.
"""

import re
import sys

MEMBER = re.compile(r"^(?P<code>\s*[^/\s][^/]*[;,{}])?(?P<gap>\s*)//(?P<kind>/?)(?!/)(?P<text>.*)$")


def escaped(text: str) -> str:
    text = re.sub(r"([\\@])", r"\\\1", text)
    for plain, safe in [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("#", "\\#"), ("::", "\\::")]:
        text = text.replace(plain, safe)
    return re.sub(r"`([^`]+)`", r"<tt>\1</tt>", text)


def is_formula(line: str) -> bool:
    return re.match(r"\s*///   ", line) is not None


def block(lines: list[str]) -> list[str]:
    """Formulas stand by themselves in a comment, indented: they keep their lines."""
    out: list[str] = []
    inside = False
    for k, line in enumerate(lines):
        formula = is_formula(line) and (inside or (k > 0 and lines[k - 1].strip() == "///"))
        if formula != inside:
            out.append("/// \\verbatim" if formula else "/// \\endverbatim")
            inside = formula
        out.append(line)
    return out


def filtered(lines: list[str]) -> list[str]:
    out, at_top, k = [], True, 0
    behind = False  # the last comment stood behind a member, and the next line may go on with it
    while k < len(lines):
        line = lines[k]
        k += 1
        if at_top and line.startswith("//"):
            if not out:
                out.append("/// \\file")
            out.append("///" + (line[2:] if is_formula("/" + line) else escaped(line[2:])))
            continue
        at_top = False
        found = MEMBER.match(line)
        if not found:
            last_code = re.match(r"^(\s*\w[^/]*\w)(\s*)//\s(.*)$", line)  # the last of an enum
            if last_code:
                out.append(f"{last_code[1]}{last_code[2]}///< {escaped(last_code[3])}")
                behind = True
                continue
            out.append(line)
            behind = False
            continue
        code, gap, kind, text = found["code"] or "", found["gap"], found["kind"], found["text"]
        if kind:
            out.append(line if is_formula(line) else f"{code}{gap}///{escaped(text)}")
            behind = False
        elif code and code.rstrip().endswith((";", ",")) and "NOLINT" not in text:
            out.append(f"{code}{gap}///<{escaped(text)}")
            behind = True
        elif not code and behind and "NOLINT" not in text:
            out.append(f"{gap}///<{escaped(text)}")
        else:
            out.append(line)
            behind = False
    return block(out)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        print("\n".join(filtered(file.read().split("\n"))))
