// Milliseconds against millimetres: every variant that was measured, the front joined, what others dominate hollow.

const STAGE_SHAPES = {mesh: ['circle', 'all stages'], skeleton: ['square', 'to the skeleton stage'],
    static: ['triangle', 'static stage alone']};
const SHAPE_PATHS = {
  circle: (r) => `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`,
  square: (r) => `M${-0.88 * r} ${-0.88 * r}h${1.76 * r}v${1.76 * r}h${-1.76 * r}z`,
  triangle: (r) => `M0 ${-1.15 * r}L${1.1 * r} ${0.8 * r}H${-1.1 * r}z`,
};
const MARK_RADIUS = 6;

const comparedMm = (v) => (v.truth || v.fp32).position_mm.mean;
const precisionColor = (v) => VARIANT_COLORS[v.name.endsWith('/outside') ? 'outside' : v.precision] || 'var(--ink)';

function shapeMark(stages, x, y, color, hollow, ...children) {
  const [shape] = STAGE_SHAPES[stages] || STAGE_SHAPES.mesh;
  return element('path', {d: SHAPE_PATHS[shape](MARK_RADIUS), transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})`,
                          stroke: color, 'stroke-width': 1.8, fill: hollow ? 'var(--card)' : color, class: 'mark'},
                         ...children);
}

// Down to each point of the front, then level to the next: above and right of the line there is something as good or
// better.
function frontLine(front, x, y, box) {
  let d = `M${x.at(front[0].tick_ms.p50).toFixed(1)} ${box.top}`;
  for (const v of front) d += `H${x.at(v.tick_ms.p50).toFixed(1)}V${y.at(comparedMm(v)).toFixed(1)}`;
  return element('path', {d: `${d}H${box.right}`, class: 'front'});
}

// Precisions as colours, stages as shapes, dominated as hollow; what is not in the picture is not in the key.
function paretoKey(svg, rows, width) {
  let left = 0, y = 12;
  const add = (text, mark) => {
    const step = 38 + 6.4 * text.length;
    if (left + step > width) left = 0, y += 22;
    svg.append(mark(left + 8), element('text', {x: left + 20, y: y + 4, class: 'note'}, text));
    left += step;
  };
  for (const precision of ['fp32', 'fp16', 'int8']) {
    const found = rows.find((v) => v.precision === precision);
    if (found) add(precision, (x) => shapeMark('mesh', x, y, VARIANT_COLORS[precision], false));
  }
  for (const [stages, [, text]] of Object.entries(STAGE_SHAPES)) {
    if (rows.some((v) => v.stages === stages)) add(text, (x) => shapeMark(stages, x, y, 'var(--ink)', false));
  }
  if (rows.some((v) => v.dominated)) add('dominated', (x) => shapeMark('mesh', x, y, 'var(--soft)', true));
}

function paretoTitle(v) {
  const parts = [v.name, `${formatNumber(comparedMm(v))} mm`,
      `p50 ${formatNumber(v.tick_ms.p50)} ms, p99 ${formatNumber(v.tick_ms.p99)} ms`,
                 `${formatNumber(v.model_bytes / 1e6)} MB`];
  if (v.rank) parts.push(`${v.rank} rows`);
  if (v.dominated_by) parts.push(`dominated by ${v.dominated_by}`);
  return parts.join(' · ');
}

// The label, with a line to its mark where it does not stand beside it.
function markLabel(svg, v, x, y, box, placed) {
  const at = labelPlace(x, y, v.name, box, placed), color = precisionColor(v);
  const nearX = clamp(x, at.x, at.x + at.width), nearY = clamp(y, at.y, at.y + at.height);
  if (Math.hypot(nearX - x, nearY - y) > 2.2 * MARK_RADIUS) {
    svg.append(element('line', {x1: x, y1: y, x2: nearX, y2: nearY, stroke: color, 'stroke-width': 0.8}));
  }
  svg.append(element('text', {x: at.x, y: at.y + 10, class: 'note', fill: color}, v.name));
}

// `select` shows a variant; `wide` is for many of them.
function paretoChart(select, wide) {
  const rows = report.variants.filter((v) => v.tick_ms && v.fp32);
  if (rows.length === 0) return null;
  const box = wide ? {left: 52, right: 1130, top: 66, bottom: 420} : {left: 52, right: 540, top: 84, bottom: 300};
  const svg = element('svg',
      {viewBox: `0 0 ${box.right + 20} ${box.bottom + 44}`, role: 'img', 'aria-label': 'Speed against error'});
  const base = report.variants.find((v) => v.name === 'skinning' && v.truth);
  const x = makeScale(rows.map((v) => v.tick_ms.p50), box.left, box.right);
  // Plain skinning is drawn to scale unless that would press the others together.
  const errors = rows.map(comparedMm), onScale = base && comparedMm(base) < 3 * Math.max(...errors);
  const y = makeScale(onScale ? errors.concat(comparedMm(base)) : errors, box.bottom, box.top, false, 1.5);
  const against = rows.some((v) => v.truth) ? 'mean error to the simulation' : 'mean difference to fp32';
  axes(svg, x, y, box, `tick, p50, ms, cold cache${x.log ? ', log' : ''}`, `${against}, mm${y.log ? ', log' : ''}`);
  paretoKey(svg, rows, box.right + 20);
  const placed = rows.map((v) => ({x: x.at(v.tick_ms.p50) - 8, y: y.at(comparedMm(v)) - 8, width: 16, height: 16}));
  if (base) {
    const at = onScale ? y.at(comparedMm(base)) : box.top, color = VARIANT_COLORS.skinning;
    const text = onScale ? 'plain skinning' : `plain skinning ${formatNumber(comparedMm(base))} mm ↑`;
    svg.append(element('line', {x1: box.left, x2: box.right, y1: at, y2: at, stroke: color, 'stroke-dasharray': '4 4'}),
               element('text', {x: box.right, y: at - 6, class: 'note', 'text-anchor': 'end', fill: color}, text));
    placed.push({x: box.right - 7 * text.length, y: at - 20, width: 7 * text.length, height: 22});
  }
  const front = rows.filter((v) => v.dominated === false).sort((a, b) => a.tick_ms.p50 - b.tick_ms.p50);
  if (front.length > 0) svg.append(frontLine(front, x, y, box));
  // The front is drawn last, above what it dominates.
  for (const v of [...rows.filter((r) => r.dominated !== false), ...front]) {
    const mark = shapeMark(v.stages, x.at(v.tick_ms.p50), y.at(comparedMm(v)), precisionColor(v), v.dominated !== false,
                           element('title', {}, paretoTitle(v)));
    mark.addEventListener('click', () => select(v.name));
    svg.append(mark);
  }
  for (const v of wide ? rows.filter((r) => !r.dominated) : rows) {
    markLabel(svg, v, x.at(v.tick_ms.p50), y.at(comparedMm(v)), box, placed);
  }
  return svg;
}
