// What tests run in the page of the playground, whose Playground is window.tested.

const {simulation} = window.tested;
const {plant, controller} = simulation.fmus;

/** Doubles as text that keeps their bits. */
function encoded(numbers) {
  const bytes = new Uint8Array(Float64Array.from(numbers).buffer);
  let text = '';
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}

// ---- The bits of trajectories -------------------------------------------------------------------

/** Outputs of the plant after each step of 1 ms, with a row of inputs for each. */
function trajectory(values, inputs, outputs, inputNames) {
  plant.call('fmi2Reset');
  plant.setUp(0);
  for (const [name, value] of Object.entries(values)) plant.set(name, value);
  plant.initialize();
  const given = plant.reals(inputNames), read = plant.reals(outputs), numbers = [];
  inputs.forEach((row, n) => {
    given.set(row);
    plant.doStep(n * 1e-3, 1e-3);
    numbers.push(...read.get());
  });
  return numbers;
}

/** Bytes of the state after these inputs, serialized, as numbers. */
function serialized(values, inputs, outputs, inputNames) {
  trajectory(values, inputs, outputs, inputNames);
  const state = plant.saveState(), place = plant.allocate(4);
  plant.call('fmi2SerializedFMUstateSize', state, place);
  const [size] = new Uint32Array(plant.buffer, place, 1), bytes = plant.allocate(size);
  plant.call('fmi2SerializeFMUstate', state, bytes, size);
  return [...new Uint8Array(plant.buffer, bytes, size)];
}

/** Outputs of the plant under the controller, with a row of efforts added in each step. */
function coupled(values, reference, efforts, outputs) {
  simulation.start(values);
  simulation.isControlled = true;
  simulation.reference = reference;
  const read = plant.reals(outputs), numbers = [];
  for (const row of efforts) {
    simulation.efforts = row;
    simulation.step();
    numbers.push(...read.get());
  }
  return numbers;
}

/** Inputs of the plant, then its outputs, in 1000 steps; a hand pulls from step 100 to 700. */
function dragged(values, outputs, inputNames) {
  simulation.start(values);
  const given = plant.reals(inputNames), read = plant.reals(outputs), inputs = [], numbers = [];
  for (let n = 0; n < 1000; n++) {
    if (n === 100) simulation.hand.target = [0.2, 0.5];
    if (n === 700) simulation.hand.target = null;
    simulation.step();
    inputs.push(...given.get());
    numbers.push(...read.get());
  }
  return [...inputs, ...numbers];
}

/** Outputs of 500 steps twice: before the second time, `way` brings the simulation back. */
function again(values, outputs, way) {
  simulation.start(values);
  simulation.isControlled = true;
  simulation.reference = [0.5, 0.1];
  const read = plant.reals(outputs);
  const run = () => {
    const numbers = [];
    for (let n = 0; n < 500; n++) {
      simulation.efforts = [3 * Math.sin(0.01 * simulation.steps), 1];
      simulation.step();
      numbers.push(...read.get());
    }
    return numbers;
  };
  const ways = {
    saved: () => {
      window.tested.save();
      const first = run();
      window.tested.restore();
      return first;
    },
    kept: () => {
      const first = run();
      simulation.goBack(0.4);
      return first;
    },
    method: () => {
      window.tested.save();
      const first = run();
      simulation.change('plant', 'solver_method', 3);
      run();
      window.tested.restore();
      return first;
    },
  };
  for (let n = 0; n < 400; n++) simulation.step();
  return [...ways[way](), ...run()];
}

// ---- Whatever users do --------------------------------------------------------------------------

/** Changes one after the other, 20 steps after each; where a step fails, as the page goes back. */
function torture(changes) {
  const counts = {accepted: 0, refused: 0, failed: 0};
  simulation.change('plant', 'max_internal_steps', 1000);  // a stiff joint fails, in milliseconds
  simulation.isControlled = true;
  for (const [fmu, name, value] of changes) {
    try {
      simulation.change(fmu, name, value);
      counts.accepted++;
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      counts.refused++;
    }
    try {
      for (let n = 0; n < 20; n++) simulation.step();
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      counts.failed++;
      if (!simulation.goBack(simulation.time)) throw new Error('there is no state to go back to');
    }
  }
  counts.energy = plant.get('total_energy');
  counts.steps = simulation.steps;
  return counts;
}

// ---- FMUs of users ------------------------------------------------------------------------------

/** Drop a file, its bytes in base64; what the page says of it, '' once it is loaded and paused. */
async function dropped(name, encodedBytes) {
  const {own} = window.tested, notice = document.getElementById('notice'), data = new DataTransfer();
  notice.hidden = true;
  data.items.add(new File([Uint8Array.from(atob(encodedBytes), (sign) => sign.charCodeAt(0))], name));
  document.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true, cancelable: true}));
  for (let i = 0; i < 6000 && notice.hidden && window.tested.own === own; i++) {
    await new Promise(next => setTimeout(next, 10));
  }
  if (window.tested.own !== own) window.tested.own.play(false);
  return notice.hidden ? '' : notice.textContent;
}

/** Move a slider of the FMU of a user. */
function slide(name, value) {
  const slider = document.getElementById(`own-${name}`);
  slider.value = value;
  slider.dispatchEvent(new Event('input'));
  return slider.valueAsNumber;
}

/** From its start, `count` steps; values of variables then. */
function stepped(count, names) {
  const {own} = window.tested;
  own.reset();
  for (let n = 0; n < count; n++) {
    own.fmu.doStep(own.time, own.step);
    own.steps++;
    for (const chart of own.charts) chart.add(own.time);
  }
  for (const chart of own.charts) chart.draw();
  return [own.time, ...names.map(name => own.fmu.get(name))];
}

// ---- Running, time and memory -------------------------------------------------------------------

/** Start, and keep what the last chart gets in window.rows. */
function recorded() {
  window.rows = [];
  const chart = window.tested.charts.at(-1), add = chart.add.bind(chart);
  chart.add = time => {
    window.rows.push([time, ...chart.source.get()]);
    add(time);
  };
  window.tested.play(true);
}

/** States that are left of a benchmark whose force becomes too large in step 100. */
function leaksOfBenchmark() {
  const {advance, save, free} = simulation, end = simulation.steps + 100;
  let count = 0;
  simulation.save = () => { count++; return save.call(simulation); };
  simulation.free = saved => { count--; free.call(simulation, saved); };
  simulation.advance = () => {
    if (simulation.steps === end) simulation.efforts[0] = 1e300;
    advance.call(simulation);
  };
  document.getElementById('measure').click();
  Object.assign(simulation, {advance, save, free});
  return count;
}

/** A second, its q1 in window.q1, then the slider of the history. */
function backInHistory(time) {
  window.q1 = [];
  for (let n = 0; n <= 1000; n++) {
    window.q1.push(plant.get('q1'));
    simulation.step();
  }
  window.tested.show();
  const slider = document.getElementById('history');
  slider.value = time;
  slider.dispatchEvent(new Event('input'));
}

/** Bytes of both FMUs after each of three runs of 15 s. */
function sizesOfMemory() {
  const sizes = [];
  simulation.hand.target = [0.3, 0.3];
  for (let turn = 0; turn < 3; turn++) {
    for (let n = 0; n < 15000; n++) simulation.step();
    window.tested.save();
    sizes.push([plant.buffer.byteLength, controller.buffer.byteLength]);
  }
  return sizes;
}

/** How many colours the drawing has. */
function coloursOfStage() {
  const canvas = document.getElementById('stage');
  const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const found = new Set();
  for (let i = 0; i < data.length; i += 4) found.add(data.slice(i, i + 4).join());
  return found.size;
}
