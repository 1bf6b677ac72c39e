"""The page's looks: light and dark by what the reader's system prefers, and paper."""

from __future__ import annotations

import re

from ..style import ESTIMATE, LUT, RGB, RUN_COLORS
from .markup import Markup

DARKER = 0.7  # of the colors' brightness on white ground, so that lines stand out from it

DARK = {
    "ground": "#101114", "panel": "#181a1f", "ink": "#e6e8ec", "soft": "#aaaeb8", "line": "#33363d",
    "free": "#1e2025", "solid": "#5c5e66", "wall": "#c4c6cc", "truth": "#ffffff", "odometry": "#aaaeb8",
    "wood": "#3e2c1e", "carpet": "#222c42", "floor0": "#28362e", "floor1": "#38283a", "floor2": "#343428",
    "accent": "#ffd05c",
}  # fmt: skip
LIGHT = {
    "ground": "#ffffff", "panel": "#f5f6f8", "ink": "#1b1d22", "soft": "#565b66", "line": "#d5d8de",
    "free": "#fafaf8", "solid": "#c2c5cc", "wall": "#33363d", "truth": "#000000", "odometry": "#6b7080",
    "wood": "#f0e4d4", "carpet": "#dbe4f2", "floor0": "#e0eee5", "floor1": "#efe2f0", "floor2": "#eeeedd",
    "accent": "#6b4a00",
}  # fmt: skip

RULES = """
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",
  Roboto,"Noto Sans","DejaVu Sans",sans-serif;overflow-wrap:break-word}
header,main,footer{max-width:1120px;margin:0 auto;padding:0 20px}
header{padding-top:24px}
h1{margin:0 0 4px;font-size:1.9rem;line-height:1.2}
h2{margin:40px 0 12px;border-bottom:1px solid var(--line);padding-bottom:4px;font-size:1.35rem}
h3{margin:20px 0 6px;font-size:1.05rem}
p,ul{max-width:75ch;margin:8px 0}
footer{padding-bottom:40px;color:var(--soft);font-size:.875rem}
nav ul{list-style:none;padding:0;display:flex;flex-wrap:wrap;gap:4px 18px}
a{color:inherit;text-underline-offset:3px}
figure{margin:0}
figcaption,caption{color:var(--soft);font-size:.875rem;text-align:left}
figcaption strong,caption{color:var(--ink)}
caption{padding-bottom:6px;font-weight:600}
.wide{overflow-x:auto;margin:12px 0}
table{border-collapse:collapse;font-size:.9375rem;font-variant-numeric:tabular-nums}
th,td{padding:4px 14px 4px 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
thead th{color:var(--soft);font-weight:600}
tbody th{font-weight:400}
.figures td,.figures thead th+th{text-align:right}
.facts td{max-width:46ch}
code,pre{font:.8125rem/1.45 ui-monospace,"SF Mono",Menlo,Consolas,"DejaVu Sans Mono",monospace}
pre{background:var(--panel);padding:12px;border-radius:6px;white-space:pre-wrap;columns:2;column-gap:24px}
svg{display:block;width:100%;height:auto;overflow:visible}
svg text{fill:var(--soft);font-size:13px}
svg text.name{fill:var(--ink)}
.charts{display:grid;grid-template-columns:repeat(2,1fr);gap:24px}
.plan>svg{margin:0 auto}
.key{display:inline-flex;align-items:center;gap:6px;margin:0 14px 0 4px;color:var(--ink)}
.key svg{display:inline-block;height:12px;width:auto}
.grid{stroke:var(--line)}
.axis{stroke:var(--soft)}
.event{stroke:var(--soft);stroke-dasharray:3 3}
.tick{stroke:var(--ink);stroke-width:1.5}
.line{fill:none;stroke:currentColor;stroke-width:1.8;stroke-linejoin:round}
.dot{fill:currentColor}
.ring{fill:none;stroke:currentColor;stroke-width:2}
circle.badge{fill:var(--accent)}
svg text.badge{fill:var(--ground);font-size:11px;font-weight:700}
.free{fill:var(--free);stroke:var(--line)}
.solid{fill:var(--solid)}
.wall{stroke:var(--wall);stroke-width:3;stroke-linecap:square}
.wood{fill:var(--wood)}
.carpet{fill:var(--carpet)}
.floor0{fill:var(--floor0)}
.floor1{fill:var(--floor1)}
.floor2{fill:var(--floor2)}
.truth{color:var(--truth)}
.odometry{color:var(--odometry)}
.estimate{color:var(--estimate)}
.scene{margin:20px 0;padding:12px;background:var(--panel);border-radius:6px}
.scene h3{margin:0 0 6px}
.scene ul{margin:0 0 8px;padding-left:20px}
.shots{display:grid;grid-template-columns:minmax(0,240px) 1fr;gap:12px;align-items:start}
.maps{display:flex;flex-wrap:wrap;gap:12px}
.maps figure{flex:1 1 300px;max-width:560px}
.shots img{display:block;width:100%;height:auto;border-radius:4px;background:#101114}
.ramp{display:inline-block;width:90px;height:10px;margin:0 6px;vertical-align:baseline}
.disk{display:inline-block;width:11px;height:11px;border-radius:50%;
  border:1px solid #565b66}
.none{display:flex;align-items:center;justify-content:center;min-height:120px;
  border:1px dashed var(--line);color:var(--soft);font-size:.875rem;padding:8px;text-align:center}
.stack td:nth-child(2),.events td:not(:last-child){white-space:nowrap}
@media (max-width:760px){
  .charts{grid-template-columns:1fr}
  pre{columns:1}
  header,main,footer{padding-left:14px;padding-right:14px}
  h1{font-size:1.5rem}
  .shots{grid-template-columns:1fr}
  .camera{max-width:240px}
  th,td{padding-right:10px}
}
@media screen and (max-width:600px){
  .stack thead{display:none}
  .stack tr{display:flex;flex-wrap:wrap;gap:0 12px;padding:6px 0;border-bottom:1px solid var(--line)}
  .stack tr>*{border:0;padding:0}
  .stack tbody th{font-weight:600}
  .stack td:last-child{flex-basis:100%}
  .stack td:empty{display:none}
  .stack td a{padding:4px 0}
}
@media print{
  @page{size:A4;margin:14mm}
  body{font-size:10pt}
  header,main,footer{max-width:none;padding:0}
  nav,details{display:none}
  h2{margin-top:24px}
  h2,h3,caption{break-after:avoid}
  figure,.scene,tr,svg,img,pre{break-inside:avoid}
  .wide{overflow:visible}
  .charts{grid-template-columns:repeat(2,1fr);gap:12px 16px}
  .charts svg text{font-size:16px}
  .charts svg text.badge{font-size:12px}
  .plan>svg{max-width:150mm!important}
  .shots{grid-template-columns:42mm 1fr}
  .maps{flex-wrap:nowrap;gap:8px}
  .maps figure{flex:1 1 0;max-width:74mm}
  .scene{padding:6px 10px;margin:8px 0}
  .shots figcaption{font-size:8pt}
  pre{font-size:7.5pt;columns:2}
  thead{display:table-header-group}
  *{print-color-adjust:exact;-webkit-print-color-adjust:exact}
}
"""


def css() -> Markup:
    """Give the style sheet."""
    light, dark = _variables(LIGHT, DARKER), _variables(DARK, 1.0)
    ramp = ",".join(_hex((c >> 24, c >> 16 & 255, c >> 8 & 255)) for c in LUT[::51].tolist())
    return Markup(
        f":root{{color-scheme:light dark;{light}}}"
        f"@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}"
        + "".join(f".run{k}{{color:var(--run{k})}}" for k in range(len(RUN_COLORS)))
        + f".ramp{{background:linear-gradient(90deg,{ramp})}}"
        + re.sub(r"\n *", "", RULES)
    )


def _variables(colors: dict[str, str], brightness: float) -> str:
    runs = {f"run{k}": _hex(color, brightness) for k, color in enumerate(RUN_COLORS)}
    named = colors | runs | {"estimate": _hex(ESTIMATE, brightness)}
    return "".join(f"--{name}:{color};" for name, color in named.items())


def _hex(color: RGB, brightness: float = 1.0) -> str:
    return "#" + "".join(f"{round(part * brightness):02x}" for part in color)
