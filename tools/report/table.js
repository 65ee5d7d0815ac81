// Headline figures and the table: the same rows that `dcloth evaluate` prints.

function plainRows() {
  return report.variants;
}

// The figures a reader looks for first, of the smallest full model that was measured.
function headline() {
  const full = report.variants.filter((v) => v.tick_ms && v.model_bytes && !/[/@]/.test(v.name));
  if (full.length === 0) return null;
  const best = full.reduce((a, b) => (b.model_bytes < a.model_bytes ? b : a));
  const base = report.variants.find((v) => v.name === 'skinning' && v.truth);
  const tile = (value, unit, label, note) => element('div', {class: 'tile'},
      element('div', {class: 'value'}, value, element('span', {class: 'unit'}, unit)),
      element('div', {class: 'label'}, label), element('div', {class: 'hint'}, note));
  const tiles = [tile(formatNumber(best.tick_ms.p99), 'ms', 'a tick, p99',
      `${best.name}, cold cache, one core of ${report.cpu}`)];
  if (best.truth) {
    tiles.push(tile(formatNumber(best.truth.position_mm.mean), 'mm', 'from the simulation',
                    base ? `mean; plain skinning ${formatNumber(base.truth.position_mm.mean)} mm`
                        : 'mean over vertices and frames'));
  }
  if (best.fp32 && best.name !== 'fp32') {
    tiles.push(tile(formatNumber(best.fp32.position_mm.mean), 'mm', 'lost to quantisation',
                    `mean difference to fp32; max ${formatNumber(best.fp32.position_mm.max)} mm`));
  }
  const fp32 = full.find((v) => v.name === 'fp32');
  tiles.push(tile(formatNumber(best.model_bytes / 1e6), 'MB', 'model',
                  fp32 && fp32 !== best ? `${formatNumber(fp32.model_bytes / best.model_bytes, 2)}× smaller than fp32`
                      : 'used where it lies'));
  tiles.push(tile(formatNumber(best.instance_bytes / 1024), 'KiB', 'a garment instance', 'memory that the host lends'));
  return element('div', {class: 'tiles'}, ...tiles);
}

function resultTable(select) {
  const rows = plainRows();
  if (rows.length === 0) return null;
  const ms = (t, key) => (t ? formatNumber(t[key]) : '–');
  const mm = (e, key) => (e ? formatNumber(e.position_mm[key]) : '–');
  const spread = (e) => (e ? `${formatNumber(e.mean)} ± ${formatNumber(e.std)}` : '–');
  const columns = [
    ['Variant', (v) => v.name], ['Stages', (v) => v.stages], ['Rank', (v) => v.rank || '–'],
    ['Model, MB', (v) => (v.model_bytes ? formatNumber(v.model_bytes / 1e6) : '–')],
    ['Instance, KiB', (v) => (v.instance_bytes ? formatNumber(v.instance_bytes / 1024) : '–')],
    ['p50', (v) => ms(v.tick_ms, 'p50'), 'Tick, ms, cold cache'], ['p95', (v) => ms(v.tick_ms, 'p95')],
    ['p99', (v) => ms(v.tick_ms, 'p99')], ['max', (v) => ms(v.tick_ms, 'max')],
    ['p50 warm', (v) => ms(v.tick_warm_ms, 'p50')],
    ['E_d, mm', (v) => spread(v.truth && v.truth.position_mm), 'Error to the simulation'],
    ['p99', (v) => mm(v.truth, 'p99')],
    ['max', (v) => mm(v.truth, 'max')],
    ['of motion', (v) => (v.truth && v.truth.relative_error !== null
        ? `${formatNumber(100 * v.truth.relative_error)} %` : '–')],
    ['E_n, °', (v) => spread(v.truth && v.truth.normal_deg)],
    ['mean', (v) => mm(v.fp32, 'mean'), 'Difference to fp32, mm'], ['p99', (v) => mm(v.fp32, 'p99')],
    ['max', (v) => mm(v.fp32, 'max')],
    ['', (v) => (v.dominated === null ? '–' : v.dominated_by || 'front'), 'Dominated by'],
  ];
  const groups = [];
  columns.forEach(([, , group], i) => {
    if (group || i === 0) groups.push([group || '', 1]);
    else groups[groups.length - 1][1]++;
  });
  return element('div', {class: 'scroll'}, element('table', {},
      element('thead', {},
          element('tr', {class: 'groups'}, ...groups.map(([text, span]) => element('th', {colspan: span}, text))),
          element('tr', {}, ...columns.map(([title]) => element('th', {}, title)))),
      element('tbody', {},
          ...rows.map((v) => element('tr', {onclick: () => select(v.name), class: v.dominated ? 'dominated' : ''},
          ...columns.map(([, text], i) => (i === 0
              ? element('td', {}, element('i', {style: `background:${variantColor(v.name)}`}), text(v))
              : element('td', {}, text(v)))))))));
}
