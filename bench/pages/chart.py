"""Log-log pictures as SVG without a plotting library, legible on light and on dark pages."""
import html
import math

# Class -> light, dark. Blue, orange, green and violet of about the same lightness, told apart by the colour-blind too.
COLORS = {"a": ("#2166c2", "#6cb0ff"), "b": ("#c8540a", "#ff9e57"), "c": ("#157f5b", "#4ecb9b"),
          "d": ("#7a4fc0", "#b998f5")}
INKS = {"card": ("#ffffff", "#15191f"), "grid": ("#e3e6ea", "#2b313a"), "ink": ("#1c2128", "#e8eaed"),
        "soft": ("#5b6470", "#9aa4b1")}
FONT = "-apple-system, 'Segoe UI', 'Helvetica Neue', 'Liberation Sans', Arial, sans-serif"
CHARACTER, BOLD = 6.6, 7.5    # about the width of one at 12 px
LEAST_SPAN = 4    # of a y axis: highest over lowest, or a flat curve would look steep


def _rules(which):
    ink = {name: pair[which] for name, pair in INKS.items()}
    rules = [f".card{{fill:{ink['card']};stroke:{ink['grid']}}}", f".grid{{stroke:{ink['grid']}}}",
             f".t{{fill:{ink['ink']}}}",
             f".s{{fill:{ink['soft']}}}", f".note{{stroke:{ink['soft']}}}", f".halo{{stroke:{ink['card']}}}"]
    for name, pair in {**COLORS, "n": INKS["soft"]}.items():    # n: a mark of no colour, in a key
        rules += [f".l{name}{{stroke:{pair[which]}}}", f".f{name}{{fill:{pair[which]}}}",
                  f".h{name}{{fill:{ink['card']}}}"]
    return "".join(rules)


def style():
    return (f"<style>{_rules(0)}@media(prefers-color-scheme:dark){{{_rules(1)}}}"
            "path,line,polyline{fill:none}.halo{stroke-width:3;stroke-linejoin:round;paint-order:stroke}</style>")


def svg(width, height, parts, label):
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'role="img" aria-label="{html.escape(label)}" font-family="{FONT}" font-size="12">', style(),
        f'<rect class="card" x=".5" y=".5" width="{width - 1}" height="{height - 1}" rx="10"/>', *parts, "</svg>", ""])


def number(value):
    """1512 -> 1.5k; 0.05 -> 0.05."""
    return f"{value / 1000:.2g}k" if value >= 1000 else f"{value:.3g}"


def ticks(low, high):
    """Powers of ten within [low, high], with 2 and 5 or more between them where those are few."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7)):
        found = [m * 10.0 ** power for power in powers
                 for m in steps if low * 0.999 <= m * 10.0 ** power <= high * 1.001]
        if len(found) >= 3:
            break
    return found


class Panel:
    """Axes in a box (left, top, right, bottom) of the picture; `xs`, `ys` are all that it must show, positive."""

    def __init__(self, box, xs, ys, x_ticks=None, margin=(1.12, 1.3)):
        self.left, self.top, self.right, self.bottom = box
        self.x_low, self.x_high = min(xs) / margin[0], max(xs) * margin[0]
        self.y_low, self.y_high = min(ys) / margin[1], max(ys) * margin[1]
        if self.y_high / self.y_low < LEAST_SPAN:
            middle = math.sqrt(self.y_low * self.y_high)
            self.y_low, self.y_high = middle / math.sqrt(LEAST_SPAN), middle * math.sqrt(LEAST_SPAN)
        self.x_ticks = x_ticks or ticks(self.x_low, self.x_high)

    def x(self, value):
        return self.left + (self.right - self.left) * math.log(value / self.x_low) / math.log(self.x_high / self.x_low)

    def y(self, value):
        way = math.log(value / self.y_low) / math.log(self.y_high / self.y_low)
        return self.bottom - (self.bottom - self.top) * way

    def axes(self, title, x_title):
        out = [text(self.left - 40, self.top - 16, title, "t", weight=600)]
        last = -1e9
        for value in self.x_ticks:
            x = self.x(value)
            out.append(f'<path class="grid" d="M{x:.1f} {self.top}V{self.bottom}"/>')
            if x - last >= CHARACTER * (len(number(value)) + 1):
                out.append(text(x, self.bottom + 17, number(value), "s", "middle"))
                last = x
        for value in ticks(self.y_low, self.y_high):
            out.append(f'<path class="grid" d="M{self.left} {self.y(value):.1f}H{self.right}"/>')
            out.append(text(self.left - 7, self.y(value) + 4, number(value), "s", "end"))
        return out + [text((self.left + self.right) / 2, self.bottom + 36, x_title, "s", "middle")]

    def mark_x(self, value, label):
        """A dashed line at a place of the x axis, with its name at the foot."""
        x = self.x(value)
        end = "end" if x > (self.left + self.right) / 2 else "start"
        return [f'<path class="note" stroke-dasharray="3 4" d="M{x:.1f} {self.top}V{self.bottom}"/>',
                text(x + (-5 if end == "end" else 5), self.bottom - 7, label, "s halo", end)]

    def line(self, points, color, tails=()):
        """Points joined; `tails` are upper ends of thin lines that start at the points."""
        out = [f'<path class="l{color}" stroke-opacity=".45" d="M{self.x(x):.1f} {self.y(y):.1f}V{self.y(tail):.1f}"/>'
               for (x, y), tail in zip(points, tails)]
        joined = " ".join(f"{self.x(x):.1f},{self.y(y):.1f}" for x, y in points)
        out.append(f'<polyline class="l{color}" stroke-width="2" points="{joined}"/>')
        return out + [f'<circle class="f{color}" cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="3.2"/>'
                      for x, y in points]

    def names(self, ends, gap=15):
        """{(name, colour): last point} written right of the box, apart from each other."""
        places = sorted(([self.y(point[1]) + 4, name, color] for (name, color), point in ends.items()), reverse=True)
        for upper, lower in zip(places[1:], places):
            upper[0] = min(upper[0], lower[0] - gap)
        return [text(self.right + 8, y, name, f"f{color}", weight=600) for y, name, color in places]


def text(x, y, content, cls, anchor="start", weight=None):
    bold = f' font-weight="{weight}"' if weight else ""
    return f'<text class="{cls}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{bold}>{html.escape(content)}</text>'


class Labels:
    """Places for texts beside marks, in a box, none over another or over a mark."""

    def __init__(self, panel, marks, radius=8):
        self.panel = panel
        self.taken = [(x - radius, y - radius, x + radius, y + radius) for x, y in marks]

    def place(self, x, y, content):
        """Left end and baseline, and whether it stands beside its mark; None where there is no room."""
        width, height = BOLD * len(content), 13
        for far in (0, 14, 30, 48, 70):
            for dx, dy in ((11 + far, 4), (-11 - far - width, 4), (-width / 2, -11 - far), (-width / 2, 21 + far),
                           (9 + far, -9 - far), (9 + far, 17 + far), (-9 - far - width, -9 - far),
                           (-9 - far - width, 17 + far)):
                box = (x + dx - 1, y + dy - height + 3, x + dx + width + 1, y + dy + 3)
                inside = (box[0] >= self.panel.left and box[2] <= self.panel.right and box[1] >= self.panel.top
                          and box[3] <= self.panel.bottom)
                if inside and not any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3]
                                      for t in self.taken):
                    self.taken.append(box)
                    return x + dx, y + dy, far == 0
        return None
