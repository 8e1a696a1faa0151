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
  window.tested.reset();
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
  for (let i = 0; i < 500 && notice.hidden && window.tested.own === own; i++) {
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
