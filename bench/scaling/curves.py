"""Pictures and words for measured curves: log-log SVG without a plotting library, and where a curve bends."""
import math

COLORS = ["#3f8fd2", "#e4573d", "#2aa198"]


def cache_note(before, now, caches):
    """The local exponent of warm time, and the caches that the frame's bytes have just outgrown."""
    if before is None:
        return ""
    steps = math.log(now[0] / before[0])
    exponent = math.log(now[1]["warm"]["p50"] / before[1]["warm"]["p50"]) / steps
    left = [name for name, size in caches if before[1]["frame_bytes"] <= size < now[1]["frame_bytes"]]
    return f"{exponent:.2f}" + (f", past {' and '.join(left)}" if left else "")


def ticks(low, high):
    """1-2-5 steps within [low, high]; at least the two ends' powers."""
    found = []
    for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
        found += [m * 10.0 ** power for m in (1, 2, 5) if low * 0.999 <= m * 10.0 ** power <= high * 1.001]
    return found


def write_svg(path, x_title, y_title, curves):
    """`curves` is {name: [(x, y), ...]}, all positive."""
    width, height, left, right, top, bottom = 720, 420, 70, 24, 40, 56
    xs = [x for points in curves.values() for x, _ in points]
    ys = [y for points in curves.values() for _, y in points]
    x_low, x_high, y_low, y_high = min(xs) / 1.15, max(xs) * 1.15, min(ys) / 1.4, max(ys) * 1.4

    def at_x(x):
        return left + (width - left - right) * math.log(x / x_low) / math.log(x_high / x_low)

    def at_y(y):
        return height - bottom - (height - top - bottom) * math.log(y / y_low) / math.log(y_high / y_low)

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">',
           f'<rect width="{width}" height="{height}" fill="#fcfcfb"/>']
    for x in sorted(set(xs)):
        out.append(f'<path d="M{at_x(x):.1f} {top}V{height - bottom}" stroke="#ddd9d3"/>'
                   f'<text x="{at_x(x):.1f}" y="{height - bottom + 18}" text-anchor="middle" fill="#55585f">{x:g}</text>')
    for y in ticks(y_low, y_high):
        out.append(f'<path d="M{left} {at_y(y):.1f}H{width - right}" stroke="#ddd9d3"/>'
                   f'<text x="{left - 8}" y="{at_y(y) + 4:.1f}" text-anchor="end" fill="#55585f">{y:g}</text>')
    out.append(f'<text x="{width - right}" y="{height - 14}" text-anchor="end" fill="#55585f">{x_title}, log</text>'
               f'<text x="{left - 8}" y="22" fill="#55585f">{y_title}, log</text>')
    for i, (name, points) in enumerate(curves.items()):
        line = " ".join(f"{at_x(x):.1f},{at_y(y):.1f}" for x, y in points)
        out.append(f'<polyline points="{line}" fill="none" stroke="{COLORS[i % 3]}" stroke-width="2"/>')
        out += [f'<circle cx="{at_x(x):.1f}" cy="{at_y(y):.1f}" r="3.5" fill="{COLORS[i % 3]}"/>' for x, y in points]
        x = width - right - 90 * (len(curves) - i)
        out.append(f'<path d="M{x} 18h16" stroke="{COLORS[i % 3]}" stroke-width="3"/><text x="{x + 22}" y="22">{name}</text>')
    path.write_text("\n".join(out + ["</svg>", ""]))
