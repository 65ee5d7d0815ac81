// What is shown, mirrored in the URL's hash so that a picture can be named: #seq=0&variant=int8&frame=60&color=error

const VARIANT_COLORS = {
  truth: '#8a8f98', skinning: '#c2863a', static: '#b05a9c', skeleton: '#3f8fd2', fp32: '#5b6ee1', fp16: '#2aa198',
  int8: '#e4573d',
  outside: '#7a9a2f',
};
const VARIANT_LABELS = {
  truth: 'Simulation', skinning: 'Plain skinning', static: 'Static stage', skeleton: '+ Skeleton stage',
  fp32: 'Full, fp32', fp16: 'Full, fp16', int8: 'Full, int8', outside: 'Kept outside the body',
  cloth: 'dcloth',
};

// "int8/skeleton" is drawn like its stage and plays as "skeleton"; "int8" and "int8@64" are drawn like their precision.
const trackName = (name) => name.slice(name.indexOf('/') + 1);
function variantColor(name) {
  return VARIANT_COLORS[trackName(name).split('@')[0]] || '#5b6ee1';
}
const variantLabel = (name) => VARIANT_LABELS[name] || name.replace('/', ', ');

function readHash() {
  const given = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
  const number = (key, fallback) => Number.isFinite(parseFloat(given[key])) ? parseFloat(given[key]) : fallback;
  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  return {
    sequence: clamp(Math.round(number('seq', 0)), 0, Math.max(0, report.sequences.length - 1)),
    variant: given.variant || '',
    frame: number('frame', 0),
    color: given.color === 'error' ? 'error' : 'cloth',
    split: given.split === undefined ? null : given.split === '1',
    playing: given.play === undefined ? given.frame === undefined : given.play === '1',
    theme: given.theme === 'dark' || given.theme === 'light' ? given.theme : (dark ? 'dark' : 'light'),
    yaw: number('yaw', NaN), pitch: number('pitch', NaN), distance: number('dist', NaN),
  };
}

function writeHash(state) {
  const values = {
    seq: state.sequence, variant: state.variant, frame: Math.round(state.frame), color: state.color,
    split: state.split ? 1 : 0,
    play: state.playing ? 1 : 0, theme: state.theme,
  };
  history.replaceState(null, '', '#' + new URLSearchParams(values));
}

// Element with attributes and children; text is always set as text, for names come from files.
function element(tag, attributes = {}, ...children) {
  const svg = ['svg', 'g', 'path', 'line', 'circle', 'rect', 'text', 'polyline', 'title'].includes(tag);
  const node = svg ? document.createElementNS('http://www.w3.org/2000/svg', tag) : document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value);
  }
  node.append(...children.filter((c) => c !== null && c !== undefined));
  return node;
}

function formatNumber(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const magnitude = Math.floor(Math.log10(Math.abs(value)));
  return value.toFixed(clamp(digits - 1 - magnitude, 0, 4));
}
