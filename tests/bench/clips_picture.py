#!/usr/bin/env python3
"""Draws error against bytes, from the rows of dermis_clips_size_benchmark, as SVG.

    dermis_clips_size_benchmark --tsv MODEL... | tests/bench/clips_picture.py > docs/images/clips_size.svg
"""
import math
import sys

COLORS = ["#1f77b4", "#d95f02", "#2a9d4a", "#8e44ad", "#7f7f7f"]
LEFT, TOP, WIDTH, HEIGHT = 84, 16, 520, 300


def main():
    curves = {}
    for line in sys.stdin:
        fields = line.rstrip("\n").split("\t")
        if len(fields) == 4:
            model, who, size, error = fields
            curves.setdefault((model, who), []).append((float(error), int(size)))
    points = [point for curve in curves.values() for point in curve]
    x_range = [math.floor(math.log10(min(p[0] for p in points))), math.ceil(math.log10(max(p[0] for p in points)))]
    y_range = [math.floor(math.log10(min(p[1] for p in points))), math.ceil(math.log10(max(p[1] for p in points)))]

    def x(error):
        return LEFT + WIDTH * (math.log10(error) - x_range[0]) / (x_range[1] - x_range[0])

    def y(size):
        return TOP + HEIGHT * (y_range[1] - math.log10(size)) / (y_range[1] - y_range[0])

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 150} {TOP + HEIGHT + 48}" '
           'font-family="sans-serif" font-size="12">',
           '<rect width="100%" height="100%" fill="white"/>']

    def text(at_x, at_y, words, anchor="middle", more=""):
        out.append(f'<text x="{at_x:.1f}" y="{at_y:.1f}" text-anchor="{anchor}" {more}>{words}</text>')

    def line(x1, y1, x2, y2, color="#dddddd"):
        out.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{color}"/>')

    for power in range(x_range[0], x_range[1] + 1):
        line(x(10.0**power), TOP, x(10.0**power), TOP + HEIGHT)
        text(x(10.0**power), TOP + HEIGHT + 16, f"10<tspan dy='-5' font-size='9'>{power}</tspan>")
    for power in range(y_range[0], y_range[1] + 1):
        line(LEFT, y(10.0**power), LEFT + WIDTH, y(10.0**power))
        text(LEFT - 6, y(10.0**power) + 4, f"{10**power:,}", "end")
    text(LEFT + WIDTH / 2, TOP + HEIGHT + 38, "largest error / extent of the skeleton")
    text(16, TOP + HEIGHT / 2, "bytes of clips", more=f'transform="rotate(-90 16 {TOP + HEIGHT / 2})"')
    models = list(dict.fromkeys(model for model, _ in curves))
    for (model, who), curve in curves.items():
        color = COLORS[models.index(model) % len(COLORS)]
        curve.sort()
        path = " ".join(f"{x(error):.1f},{y(size):.1f}" for error, size in curve)
        dashes = "" if who.startswith("Dermis") else ' stroke-dasharray="5 4"'
        out.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"{dashes}/>')
        out.extend(f'<circle cx="{x(error):.1f}" cy="{y(size):.1f}" r="3" fill="{color}"/>' for error, size in curve)
    for index, model in enumerate(models):
        text(LEFT + WIDTH + 14, TOP + 14 + 18 * index, model, "start", f'fill="{COLORS[index % len(COLORS)]}"')
    for index, (words, dashes) in enumerate([("Dermis", ""), ("ozz-animation", ' stroke-dasharray="5 4"')]):
        height = TOP + 32 + 18 * (len(models) + index)
        out.append(f'<line x1="{LEFT + WIDTH + 14}" y1="{height - 4}" x2="{LEFT + WIDTH + 40}" y2="{height - 4}" '
                   f'stroke="black" stroke-width="2"{dashes}/>')
        text(LEFT + WIDTH + 46, height, words, "start")
    out.append("</svg>")
    print("\n".join(out))


if __name__ == "__main__":
    main()
