'use strict';
// Charts as traces and axes of plotly, from the data that the page has for each kind. Texts that begin
// with -- are colours of page.css.

const Diagrams = (() => {
  const colour = (i) => `--curve${1 + (i % 6)}`;
  const line = (color, dashed, more) => ({ color, width: 1.6, dash: dashed ? '6px,4px' : 'solid', simplify: false, ...more });
  const axis = (text, more) => ({ title: { text }, ...more });
  const across = (x, color = '--muted', dash = '2px,3px') => ({
    type: 'line', x0: x, x1: x, y0: 0, y1: 1, yref: 'paper', layer: 'below', line: { color, width: 1, dash },
  });

  /** Axes one below the other. */
  function stacked(axes) {
    const gap = 0.06;
    const height = (1 + gap) / axes.length;
    return Object.fromEntries(axes.map((own, i) => {
      const low = Math.max(0, 1 - (i + 1) * height + gap);
      return [`yaxis${i ? i + 1 : ''}`, { ...own, domain: [low, Math.min(1, low + height - gap)] }];
    }));
  }

  function circle(style) {
    const angles = Array.from({ length: 201 }, (_, i) => (i * Math.PI) / 100);
    return { x: angles.map(Math.cos), y: angles.map(Math.sin), mode: 'lines', line: style, hoverinfo: 'skip', hovertemplate: '' };
  }

  const isGain = ({ name }) => name === 'up' || name === 'down';

  function described({ name, margin }) {
    if (name === 'phase') return `phase margin: ${Charts.shown(margin, 4)} degrees`;
    if (name === 'delay') return `delay margin: ${Charts.shown(1e3 * margin, 4)} ms`;
    return `gain margin, ${name}: ${Charts.shown(margin, 4)} times`;
  }

  /** Margins by their crossings: those at the same one share a mark. */
  function shared(marks) {
    const found = [];
    for (const mark of marks) {
      const same = found.find(({ hertz, name }) => hertz === mark.hertz && isGain({ name }) === isGain(mark));
      if (same) same.texts.push(described(mark));
      else found.push({ ...mark, texts: [described(mark)] });
    }
    return found.map((mark) => ({ ...mark, text: `${mark.texts.join(', ')}, at ${Charts.shown(mark.hertz, 4)} Hz` }));
  }

  /** A margin: the piece that is left, with a marker at its ends. */
  function piece(mark, x, y) {
    const color = isGain(mark) ? '--effort' : '--good';
    return {
      x, y, name: mark.text, meta: mark.name, mode: 'lines+markers', line: { color, width: 4 }, marker: { color, size: 9 },
      hovertemplate: `${mark.text}<extra></extra>`,
    };
  }

  function interpolated(x, y, at) {
    const i = Math.max(1, x.findIndex((value) => value >= at));
    const part = (at - x[i - 1]) / (x[i] - x[i - 1]);
    return y[i - 1] + part * (y[i] - y[i - 1]);
  }

  function bode({ curves, marks: margins, crossings, ends, half }) {
    const marks = shared(margins);
    const traces = curves.flatMap(({ name, colour: i, dashed, hertz, gain, phase }) => {
      const both = { x: hertz, name, mode: 'lines', line: line(colour(i), dashed) };
      const at = (unit) => `%{x:.4~g} Hz<br>%{y:.4~g} ${unit}<extra></extra>`;
      return [
        { ...both, y: gain, hovertemplate: at('dB') },
        { ...both, y: phase, hovertemplate: at('degrees'), yaxis: 'y2', showlegend: false },
      ];
    });
    for (const mark of marks) {
      const { hertz, gain, phase } = curves[0];
      const place = [mark.hertz, mark.hertz];
      if (isGain(mark)) traces.push(piece(mark, place, [interpolated(hertz, gain, mark.hertz), 0]));
      else {
        const angle = interpolated(hertz, phase, mark.hertz);
        traces.push({ ...piece(mark, place, [angle, angle - mark.lag]), yaxis: 'y2' });
      }
    }
    // a resonance without damping must not press all else flat
    const gains = curves.flatMap(({ gain }) => gain.filter(Number.isFinite));
    const [from, to] = ends.map(Math.log10);
    const coarse = Array.from({ length: 101 }, (_, i) => 10 ** (from + (i * (to - from)) / 100));
    const usual = curves.flatMap(({ hertz, gain }) => coarse
      .filter((at) => at >= hertz[0] && at <= hertz.at(-1)).map((at) => interpolated(hertz, gain, at)))
      .filter(Number.isFinite);
    const low = Math.max(Math.min(...gains) - 5, Math.min(...usual) - 20);
    const high = Math.min(Math.max(...gains) + 5, Math.max(...usual) + 20);
    const angles = curves.flatMap(({ phase }) => phase.filter(Number.isFinite));
    const turns = Math.max(...angles) - Math.min(...angles);
    const scale = turns < 720 ? { dtick: turns < 270 ? 45 : 90, nticks: 0 } : {};
    return {
      traces,
      layout: {
        xaxis: axis('frequency (Hz)', { type: 'log', anchor: 'y2', range: ends.map(Math.log10), dtick: 1, nticks: 0 }),
        ...stacked([axis('gain (dB)', { range: [low, high] }), axis('phase (degrees)', scale)]),
        shapes: [...(half ? [across(half)] : []), ...[...crossings, ...marks.filter(isGain).map(({ hertz }) => hertz)].map((x) => across(x, '--ink'))],
      },
    };
  }

  function nyquist({ curves, marks, reach }) {
    const traces = curves.flatMap(({ name, dashed, hertz, re, im }) => {
      const both = { x: re, mode: 'lines', line: line('--curve1', dashed) };
      const mirrored = im.map((value) => (value === null ? null : -value));
      return [
        { ...both, y: im, name, text: hertz, hovertemplate: 'L at %{text:.4~g} Hz:<br>%{x:.4~g} %{y:+.4~g}i<extra></extra>' },
        { ...both, y: mirrored, opacity: 0.35, hoverinfo: 'skip', hovertemplate: '' },
      ];
    });
    traces.push(circle({ color: '--muted', width: 1, dash: '2px,3px' }));
    for (const mark of shared(marks)) traces.push({ ...piece(mark, [mark.re], [mark.im]), mode: 'markers' });
    const critical = { color: '--bad', size: 12, symbol: 'cross-thin-open', line: { width: 3, color: '--bad' } };
    traces.push({ x: [-1], y: [0], mode: 'markers', marker: critical, name: '-1' });
    const range = [-reach, reach];
    return {
      traces,
      layout: {
        xaxis: axis('real part of L', { range, constrain: 'domain' }),
        yaxis: axis('imaginary part of L', { range, scaleanchor: 'x' }),
      },
    };
  }

  function steps({ curves, outputs, end }) {
    const traces = curves.map(({ name, output, colour: i, dots, held, x, y }) => ({
      x, y, name, showlegend: output === 0 && !dots, yaxis: `y${output ? output + 1 : ''}`,
      mode: dots ? 'markers' : held ? 'lines+markers' : 'lines',
      line: line(colour(i), false, { shape: held ? 'hv' : 'linear' }),
      marker: { color: colour(i), size: 5 },
      hovertemplate: '%{x:.4~g} s<br>%{y:.5~g}<extra></extra>',
    }));
    const last = outputs.length > 1 ? `y${outputs.length}` : 'y';
    return {
      traces,
      layout: { xaxis: axis('time (s)', { range: [0, end], anchor: last }), ...stacked(outputs.map((name) => axis(name))) },
    };
  }

  function poles({ poles: sets, sampled, flattest }) {
    const none = '–';
    const text = ([real, imaginary, hertz, damping], states) => [
      `pole ${real}${imaginary === none ? '' : ` ${imaginary}i`}${sampled ? '' : ' 1/s'}`,
      ...(hertz === none ? [] : [`frequency ${hertz} Hz`]),
      ...(damping === none ? [] : [`damping ${damping}`]),
      ...states.map(Charts.escaped),
    ].join('<br>');
    const traces = sets.map(({ name, re, im, cells, states }, i) => ({
      x: re, y: im, text: cells.map((own, k) => text(own, states[k])), name: sets.length > 1 ? name : '', mode: 'markers', hovertemplate: '%{text}<extra></extra>',
      marker: { symbol: i ? 'cross-thin-open' : 'x-thin-open', size: 11, color: colour(i), line: { width: 2.5, color: colour(i) } },
    }));
    if (sampled) {
      return {
        traces: [circle({ color: '--ink', width: 1 }), ...traces],
        layout: { xaxis: axis('real part; within the circle it dies out', { constrain: 'domain' }), yaxis: axis('imaginary part', { scaleanchor: 'x' }) },
      };
    }
    const real = [0, ...sets.flatMap(({ re }) => re)];
    const imaginary = sets.flatMap(({ im }) => im);
    const size = Math.max(...sets.flatMap(({ re, im }) => re.map((x, i) => Math.hypot(x, im[i])))) || 1;
    const wide = [Math.min(...real) - flattest * size, Math.max(...real) + flattest * size];
    const tall = 1.2 * Math.max(flattest * size, ...imaginary.map(Math.abs));
    const growing = { type: 'rect', x0: 0, x1: wide[1], y0: 0, y1: 1, yref: 'paper', fillcolor: '--bad', opacity: 0.12 };
    return {
      traces,
      layout: {
        xaxis: axis('real part (1/s); on the red ground it grows', { range: wide }),
        yaxis: axis('imaginary part (rad/s)', { range: [-tall, tall] }),
        shapes: [{ ...growing, line: { width: 0 }, layer: 'below' }, across(0, '--ink', 'solid')],
      },
    };
  }

  function indices({ rows }) {
    const from = rows.toReversed();
    const bars = (key, name, color) => ({
      type: 'bar', orientation: 'h', name, marker: { color }, y: from.map(({ parameter }) => Charts.escaped(parameter)),
      x: from.map((row) => row[key]),
      error_x: { type: 'data', array: from.map((row) => row[`${key}_confidence`]), color: '--ink', thickness: 1 },
      hovertemplate: '%{y}: %{x:.3f} ± %{error_x.array:.3f}<extra></extra>',
    });
    return {
      traces: [bars('total', 'total', '--curve2'), bars('first', 'first order', '--curve1')],
      layout: { barmode: 'group', xaxis: axis("Sobol' index"), yaxis: axis('', { type: 'category' }) },
    };
  }

  function map({ runs, x, y, z, labels }) {
    const scale = { colorscale: 'Viridis', colorbar: { orientation: 'h', y: 1.02, yanchor: 'bottom', thickness: 12 } };
    const at = '%{x:.5~g}, %{y:.5~g}<br>';
    const cells = Array.isArray(runs[0]);
    const trace = cells
      ? { type: 'heatmap', z, ...scale, hovertemplate: `${at}%{z:.5~g}<extra></extra>` }
      : { mode: 'markers', marker: { color: z, size: 6, ...scale }, hovertemplate: `${at}%{marker.color:.5~g}<extra></extra>` };
    return { traces: [{ x, y, customdata: runs, ...trace }], layout: { xaxis: axis(labels[0]), yaxis: axis(labels[1]) } };
  }

  function autocorrelations({ rows, bound }) {
    const style = { color: '--ink', width: 1, dash: '6px,4px' };
    const level = (y) => ({ type: 'line', x0: 0, x1: 1, xref: 'paper', y0: y, y1: y, line: style });
    return {
      traces: rows.map(({ name, values }, i) => ({
        type: 'bar', x: values.map((_, k) => k + 1), y: values, name, marker: { color: colour(i) },
      })),
      layout: {
        barmode: 'group', xaxis: axis('lag in rows'), yaxis: axis('autocorrelation'), shapes: [level(-bound), level(bound)],
      },
    };
  }

  function correlations({ names, short, values, most }) {
    const text = values.map((row) => row.map((value) => value.toFixed(2).replace('-', '\u2212')));
    const numbers = names.length <= most ? { showscale: false, texttemplate: '%{text}' } : {};
    const both = (i, k) => Charts.escaped(`${names[i]}, ${names[k]}: ${text[i][k]}`);
    return {
      traces: [{
        type: 'heatmap', z: values, zmin: -1, zmax: 1, text, x: names.map((_, i) => String(i + 1)), y: short.map(Charts.escaped),
        customdata: values.map((row, i) => row.map((_, k) => both(i, k))), hovertemplate: '%{customdata}<extra></extra>',
        colorscale: [[0, '--curve2'], [0.5, '--paper'], [1, '--curve1']], xgap: 1, ygap: 1, ...numbers,
      }],
      layout: {
        xaxis: axis('', { type: 'category', nticks: 0 }),
        yaxis: axis('', { type: 'category', autorange: 'reversed', nticks: 0 }),
      },
    };
  }

  function bounds({ curves, x, y }) {
    const mode = ({ y: values }) => (values.filter(Number.isFinite).length > 1 ? 'lines' : 'lines+markers');
    const traces = curves.map((curve, i) => ({ ...curve, mode: mode(curve), line: line(colour(i)), marker: { color: colour(i) } }));
    return { traces, layout: { xaxis: axis(x), yaxis: axis(y, { type: 'log' }) } };
  }

  return { bode, nyquist, steps, poles, indices, map, autocorrelations, correlations, bounds };
})();
