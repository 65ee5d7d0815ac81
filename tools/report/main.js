// Puts the page together: loads geometry, wires the controls, keeps the state and the URL's hash in step.

const byId = (id) => document.getElementById(id);

function fillSelect(select, names, label, chosen) {
  select.replaceChildren(...names.map((name, i) => {
    const option = element('option', {value: i}, label(name));
    option.selected = name === chosen;
    return option;
  }));
}

function applyTheme(state) {
  document.documentElement.dataset.theme = state.theme;
}

// A round upper end for the legend, the same for every variant: three times the mean error of the last one, on a 1-2-5
// grid.
function errorScale(sequence) {
  const last = Object.values(sequence.errors).pop();
  const top = Math.max(3 * last.reduce((sum, e) => sum + e, 0) / last.length, 0.01);
  const power = 10 ** Math.floor(Math.log10(top));
  return [1, 2, 5, 10].map((m) => m * power).find((s) => s >= top);
}

function staticSections(select) {
  byId('title').textContent = report.title;
  byId('subtitle').textContent = report.subtitle;
  byId('facts').textContent = report.facts.join('  ·  ');
  const wide = report.variants.length > 9;
  byId('speed-error').closest('.pair').classList.toggle('wide', wide);
  const slots = {headline: headline(), 'speed-error': paretoChart(select, wide), stages: stageChart(),
      table: resultTable(select)};
  for (const [id, node] of Object.entries(slots)) {
    if (node) byId(id).append(node);
    else byId(id).closest('[data-optional]').hidden = true;
  }
}

class Page {
  constructor(state) {
    this.state = state;
    this.sliderHeld = false;
  }

  async start() {
    const state = this.state;
    applyTheme(state);
    staticSections((name) => this.select(name));
    byId('theme').onclick = () => {
      state.theme = state.theme === 'dark' ? 'light' : 'dark';
      applyTheme(state);
      this.changed();
    };
    if (report.sequences.length === 0) return;
    this.garment = await loadGarment();
    this.viewer = new Viewer(byId('view'), state, this.garment, await loadBody(), (frame) => this.onFrame(frame));
    this.bind();
    await this.openSequence(state.sequence);
    byId('stage').classList.remove('loading');
    document.body.dataset.ready = '1';
  }

  bind() {
    const state = this.state;
    byId('play').onclick = () => this.setPlaying(!state.playing);
    byId('speed').onchange = (e) => { state.speed = parseFloat(e.target.value); };
    byId('sequence').onchange = (e) => this.openSequence(+e.target.value);
    byId('variant').onchange = (e) => this.select(this.names[+e.target.value]);
    byId('split').onclick = () => { state.split = !state.split; this.changed(); };
    byId('color').onclick = () => { state.color = state.color === 'error' ? 'cloth' : 'error'; this.changed(); };
    byId('timeline').oninput = (e) => { this.setPlaying(false); this.seek(+e.target.value); };
    byId('full').onclick = () => {
      if (document.fullscreenElement) document.exitFullscreen();
      else byId('stage').requestFullscreen();
    };
    document.addEventListener('keydown', (e) => {
      if (e.target.tagName === 'SELECT' || e.ctrlKey || e.metaKey) return;
      if (e.key === ' ') this.setPlaying(!state.playing);
      else if (e.key === 'ArrowRight') this.seek(Math.round(state.frame) + 1);
      else if (e.key === 'ArrowLeft') this.seek(Math.round(state.frame) - 1);
      else return;
      e.preventDefault();
    });
  }

  async openSequence(index) {
    const state = this.state;
    byId('stage').classList.add('loading');
    this.sequence = await loadSequence(index, this.garment);
    byId('stage').classList.remove('loading');
    state.sequence = index;
    this.names = [...this.sequence.tracks.keys()];
    this.hasTruth = this.sequence.tracks.has('truth');
    if (!this.names.includes(state.variant)) state.variant = this.names[this.names.length - 1];
    if (state.split === null) state.split = this.hasTruth && innerWidth > 720;
    if (!this.hasTruth) state.color = 'cloth';
    state.errorScale = this.hasTruth ? errorScale(this.sequence) : 1;
    byId('timeline').max = this.sequence.frames - 1;
    for (const id of ['split', 'color']) byId(id).hidden = !this.hasTruth;
    byId('sequence').hidden = report.sequences.length < 2;
    fillSelect(byId('sequence'), report.sequences.map((s) => s.name), (n) => n, this.sequence.name);
    byId('variant').hidden = this.names.length < 2;
    this.drawErrorChart();
    this.viewer.setSequence(this.sequence);
    this.changed();
  }

  drawErrorChart() {
    const chart = errorChart(this.sequence, (frame) => { this.setPlaying(false); this.seek(frame); });
    byId('over-time').replaceChildren(...(chart ? [chart] : []));
    byId('over-time').closest('[data-optional]').hidden = !chart;
    this.chart = chart;
  }

  // A table row may name a variant that has no track of its own ("int8@64"): the nearest one is shown.
  select(name) {
    const [precision, stage] = name.split('/');
    const wanted = [trackName(name), stage, precision.split('@')[0]];
    const found = wanted.find((n) => n && this.names && this.names.includes(n));
    if (!found) return;
    this.state.variant = found;
    this.changed();
  }

  seek(frame) {
    this.state.frame = clamp(frame, 0, this.sequence.frames - 1);
    writeHash(this.state);
    this.viewer.invalidate();
  }

  setPlaying(playing) {
    this.state.playing = playing;
    this.changed();
  }

  changed() {
    const state = this.state;
    if (!this.viewer) return;
    fillSelect(byId('variant'), this.names, variantLabel, state.variant);
    byId('play').textContent = state.playing ? '❚❚' : '▶';
    byId('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
    byId('split').setAttribute('aria-pressed', state.split);
    byId('color').setAttribute('aria-pressed', state.color === 'error');
    const split = state.split && this.hasTruth && state.variant !== 'truth';
    byId('stage').classList.toggle('split', split);
    byId('left-name').textContent = split ? variantLabel('truth') : '';
    byId('right-name').textContent = variantLabel(state.variant);
    const showLegend = state.color === 'error' && state.variant !== 'truth';
    byId('legend').hidden = !showLegend;
    const colors = VIRIDIS.split(' ').map((h) => '#' + h).join(', ');
    byId('legend-bar').style.background = `linear-gradient(90deg, ${colors})`;
    byId('legend-high').textContent = `${state.errorScale} mm`;
    writeHash(state);
    this.viewer.invalidate();
  }

  onFrame(frame) {
    byId('timeline').value = frame;
    const seconds = (frame / this.sequence.fps).toFixed(2);
    byId('time').textContent = `${seconds} s`;
    if (this.chart) this.chart.moveCursor(frame);
    const errors = this.sequence.errors && this.sequence.errors[this.state.variant];
    byId('now').textContent = errors ? `${formatNumber(errors[Math.round(frame)])} mm from the simulation` : '';
  }
}

function fail(error) {
  byId('stage').classList.remove('loading');
  byId('message').hidden = false;
  byId('message').textContent = error.message;
  document.body.dataset.failed = error.message;
}

const page = new Page(Object.assign(readHash(), {speed: 1, errorScale: 1}));
page.start().catch(fail);
