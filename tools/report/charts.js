// Plots as SVG in the page's own colours: axes and labels for all, time per stage, error over time.

const STAGE_COLORS = {
  pose: '#8a8f98', static: '#b05a9c', skeleton: '#3f8fd2', mesh: '#5b6ee1', displacement: '#e4573d',
  skinning: '#c2863a', penetration: '#7a9a2e', normals: '#2aa198',
};

function ticksLinear(low, high, wanted) {
  const raw = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const out = [];
  for (let v = Math.ceil(low / step) * step; v <= high * (1 + 1e-9); v += step) out.push(+v.toPrecision(12));
  return out;
}

function ticksLog(low, high) {
  const out = [];
  const multiples = high / low < 10 ? [1, 1.5, 2, 3, 5, 7] : high / low < 30 ? [1, 2, 5] : [1, 3];
  for (let p = Math.floor(Math.log10(low)); p <= Math.ceil(Math.log10(high)); p++) {
    for (const m of multiples) {
      const v = m * 10 ** p;
      if (v >= low * 0.999 && v <= high * 1.001) out.push(+v.toPrecision(6));
    }
  }
  return out;
}

// Logarithmic where the values span more than a factor of `span` and none is zero.
function makeScale(values, from, to, forceZero, span = 4) {
  const low = Math.min(...values), high = Math.max(...values);
  if (!forceZero && low > 0 && high / low > span) {
    const a = low / 1.5, b = high * 1.5;
    const at = (v) => from + (to - from) * Math.log(v / a) / Math.log(b / a);
    return {at, ticks: ticksLog(a, b), log: true};
  }
  const b = high > 0 ? high * 1.2 : 1;
  return {at: (v) => from + (to - from) * v / b, ticks: ticksLinear(0, b, 5), log: false};
}

function axes(svg, x, y, box, xTitle, yTitle) {
  for (const v of x.ticks) {
    svg.append(element('line', {x1: x.at(v), x2: x.at(v), y1: box.top, y2: box.bottom, class: 'grid'}),
               element('text', {x: x.at(v), y: box.bottom + 18, class: 'tick', 'text-anchor': 'middle'}, `${v}`));
  }
  for (const v of y.ticks) {
    svg.append(element('line', {x1: box.left, x2: box.right, y1: y.at(v), y2: y.at(v), class: 'grid'}),
               element('text', {x: box.left - 8, y: y.at(v) + 4, class: 'tick', 'text-anchor': 'end'}, `${v}`));
  }
  svg.append(element('text', {x: box.right, y: box.bottom + 36, class: 'axis', 'text-anchor': 'end'}, xTitle),
             element('text', {x: box.left - 34, y: box.top - 10, class: 'axis'}, yTitle));
}

// The first spot around a dot where the text meets no other text and stays inside; each spot taken is remembered.
function labelPlace(cx, cy, text, box, placed) {
  const width = 7 * text.length, height = 14;
  const spots = [];
  for (let ring = 0; ring < 6; ring++) {
    const up = cy - 24 - 15 * ring, down = cy + 10 + 15 * ring;
    for (const y of [up, down]) {
      for (const x of [cx - width / 2, cx - width - 8, cx + 8]) spots.push({x, y, width, height});
    }
  }
  const free = (s) => s.x > box.left + 2 && s.x + width < box.right && s.y > box.top && s.y + height < box.bottom &&
      !placed.some((p) => s.x < p.x + p.width && p.x < s.x + width && s.y < p.y + height && p.y < s.y + height);
  const spot = spots.find(free) || spots[0];
  placed.push(spot);
  return spot;
}

// Of the variants that are shown in 3D; a grid of ranks would take a page.
function stageChart() {
  const tracks = new Set(report.sequences.flatMap((s) => s.tracks.map((t) => t.name)));
  const rows = report.variants.filter((v) => v.stages_ms && tracks.delete(trackName(v.name)));
  if (rows.length === 0) return null;
  const height = 34 * rows.length + 100;
  const svg = element('svg', {viewBox: `0 0 560 ${height}`, role: 'img', 'aria-label': 'Time per stage'});
  const sum = (v) => Object.values(v.stages_ms).reduce((total, s) => total + s.p50, 0);
  const box = {left: 104, right: 540, top: 60, bottom: height - 44};
  const x = makeScale(rows.map(sum), box.left, box.right, true);
  for (const v of x.ticks) {
    svg.append(element('line', {x1: x.at(v), x2: x.at(v), y1: box.top, y2: box.bottom, class: 'grid'}),
               element('text', {x: x.at(v), y: box.bottom + 18, class: 'tick', 'text-anchor': 'middle'}, `${v}`));
  }
  svg.append(element('text', {x: box.right, y: box.bottom + 36, class: 'axis', 'text-anchor': 'end'},
      'ms, median, cold cache'));
  let key = 0, line = 6;
  Object.entries(STAGE_COLORS).forEach(([name, color]) => {
    const width = 30 + name.length * 6.6;
    if (key + width > 560) key = 0, line += 18;
    svg.append(element('rect', {x: key, y: line, width: 10, height: 10, rx: 2, fill: color}),
               element('text', {x: key + 14, y: line + 9, class: 'note'}, name));
    key += width;
  });
  rows.forEach((v, i) => {
    const y = box.top + 6 + i * 34;
    svg.append(element('text', {x: box.left - 10, y: y + 15, class: 'note', 'text-anchor': 'end'}, v.name));
    let at = 0;
    for (const [name, color] of Object.entries(STAGE_COLORS)) {
      const ms = v.stages_ms[name] ? v.stages_ms[name].p50 : 0;
      const width = x.at(at + ms) - x.at(at);
      if (width > 0.2) {
        svg.append(element('rect', {x: x.at(at), y, width, height: 22, fill: color},
                           element('title', {}, `${v.name}, ${name}: ${formatNumber(ms)} ms`)));
      }
      at += ms;
    }
    svg.append(element('text', {x: x.at(at) + 6, y: y + 15, class: 'tick'}, formatNumber(at)));
  });
  return svg;
}

// Lines per variant and a cursor that follows playback; a click seeks.
function errorChart(sequence, seek) {
  const names = Object.keys(sequence.errors || {});
  if (names.length === 0) return null;
  const box = {left: 52, right: 1130, top: 34, bottom: 236};
  const svg = element('svg', {viewBox: '0 0 1150 285', role: 'img', 'aria-label': 'Error over time', class: 'seek'});
  const seconds = (sequence.frames - 1) / sequence.fps || 1;
  const high = Math.max(...names.flatMap((n) => sequence.errors[n]));
  const x = {at: (s) => box.left + (box.right - box.left) * s / seconds, ticks: ticksLinear(0, seconds, 8)};
  const y = makeScale([high || 1], box.bottom, box.top, true);
  axes(svg, x, y, box, 'seconds', 'mean error to the simulation, mm');
  let key = box.right;
  for (const name of [...names].reverse()) {  // the legend runs from right to left
    key -= 26 + variantLabel(name).length * 6.6;
    svg.append(element('line', {x1: key, x2: key + 14, y1: 14, y2: 14, stroke: variantColor(name), 'stroke-width': 3}),
               element('text', {x: key + 18, y: 18, class: 'note'}, variantLabel(name)));
  }
  for (const name of names) {
    const points = sequence.errors[name].map((e, f) =>
        `${x.at(f / sequence.fps).toFixed(1)},${y.at(e).toFixed(1)}`).join(' ');
    svg.append(element('polyline',
        {points, fill: 'none', stroke: variantColor(name), 'stroke-width': 1.8, 'stroke-linejoin': 'round'}));
  }
  const cursor = element('line', {y1: box.top, y2: box.bottom, class: 'cursor'});
  svg.append(cursor);
  const onPointer = (event) => {
    if (event.type === 'pointermove' && event.buttons === 0) return;
    const rect = svg.getBoundingClientRect();
    const at = (event.clientX - rect.left) / rect.width * 1150;
    seek(clamp((at - box.left) / (box.right - box.left), 0, 1) * (sequence.frames - 1));
  };
  svg.addEventListener('pointerdown', onPointer);
  svg.addEventListener('pointermove', onPointer);
  svg.moveCursor = (frame) => {
    const at = x.at(frame / sequence.fps);
    cursor.setAttribute('x1', at);
    cursor.setAttribute('x2', at);
  };
  return svg;
}
