"""Draws docs/jump.svg, the robot's shape during one jump, from the CSV on standard input. Standard library only.

    target/release/sfers preset jump-14hz | target/release/sfers run - --quiet --out - | python3 scripts/jump_svg.py > docs/jump.svg
"""

import csv
import sys

WIDTH, HEIGHT, LEFT, BOTTOM = 760, 300, 60, 240
Z_SCALE = 3.0  # heights are drawn larger than lengths, and the axis says so

rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(sys.stdin)]
nodes = sum(1 for key in rows[0] if key.startswith("node")) // 2


def shape(row):
    return [(row[f"node{i}_x_mm"], row[f"node{i}_z_mm"]) for i in range(nodes)]


heights = [min(z for _, z in shape(row)) for row in rows]
top = max(range(len(rows)), key=heights.__getitem__)
# The jump's flight: from the last time on the ground before the highest point, to the first after it.
start = max(i for i in range(top) if heights[i] < 0.05)
end = next((i for i in range(top, len(rows)) if heights[i] < 0.05), len(rows) - 1)
picks = [start - (top - start), start, (start + top) // 2, top, (top + end) // 2, end]

left = min(x for x, _ in shape(rows[0]))
scale = (WIDTH - LEFT - 150) / 500.0


def at(x, z):
    return f"{LEFT + (x - left) * scale:.1f},{BOTTOM - z * scale * Z_SCALE:.1f}"


out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">']
out.append(f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>')
for x in range(0, 501, 100):
    px = LEFT + x * scale
    out.append(f'<path d="M{px:.1f},{BOTTOM} v5" stroke="black"/><text x="{px:.1f}" y="{BOTTOM + 18}" text-anchor="middle">{x}</text>')
for z in range(0, 41, 10):
    py = BOTTOM - z * scale * Z_SCALE
    out.append(f'<path d="M{LEFT - 5},{py:.1f} h5" stroke="black"/><text x="{LEFT - 8}" y="{py + 4:.1f}" text-anchor="end">{z}</text>')
out.append(f'<path d="M{LEFT},{BOTTOM - 60 * scale * Z_SCALE:.1f} V{BOTTOM} H{LEFT + 500 * scale:.1f}" fill="none" stroke="black"/>')
out.append(f'<text x="{LEFT + 250 * scale:.1f}" y="{BOTTOM + 38}" text-anchor="middle">x (mm)</text>')
out.append(f'<text transform="translate(16,{BOTTOM - 70}) rotate(-90)" text-anchor="middle">z (mm), {Z_SCALE:g}x</text>')
for n, index in enumerate(picks):
    grey = 200 - 40 * n
    style = ["1 3", "6 3", "", "", "10 3 2 3", "3 3"][n]
    width = 3 if index == top else 1.5
    points = " ".join(at(x, z) for x, z in shape(rows[index]))
    colour = f"rgb({grey},{grey},{grey})"
    out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{style}"/>')
    y = 40 + 18 * n
    out.append(f'<path d="M{WIDTH - 135},{y - 4} h30" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{style}"/>')
    out.append(f'<text x="{WIDTH - 98}" y="{y}">{1000 * rows[index]["t_s"]:.0f} ms</text>')
out.append("</svg>")
print("\n".join(out))
