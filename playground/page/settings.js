'use strict';

/** Start values and sliders. Names and units are the FMUs'. */
const Settings = {
  /** In all scenes: erk, the method for inputs that change in each step. */
  common: {plant: {solver_method: 3}, controller: {solver_method: 3}},

  /** Scenes: further values that differ from the start values, by FMU. */
  scenes: {
    'Friction and stops': {
      plant: {
        q1: 0.9, damping1: 0.1, damping2: 1, coulomb_friction1: 0.4, breakaway_friction1: 0.8,
        stribeck_velocity1: 0.1, coulomb_friction2: 2, breakaway_friction2: 4,
        stribeck_velocity2: 0.05, stops2: 2, lower2: -0.2, upper2: 0.35, restitution2: 0.4,
        payload_mass: 1.5, payload_inertia: 0.01, payload_z: 0.08,
      },
      controller: {},
    },
    'Without friction': {
      plant: {q1: 0.9, stops2: 2, lower2: -0.2, upper2: 0.35, restitution2: 1, payload_mass: 1},
      controller: {},
    },
    'Horizontal plane': {
      plant: {
        g: 0, q1: 0.4, dq1: 3, coulomb_friction1: 0.2, coulomb_friction2: 1, stops1: 2, lower1: -2.5,
        upper1: 2.5, restitution1: 0.7, stops2: 2, lower2: -0.2, upper2: 0.35, restitution2: 0.7,
        payload_mass: 1,
      },
      controller: {g: 0},
    },
  },

  /** Groups of controls: [name, smallest, largest, step] of a slider, [name] of a choice. */
  groups: [
    {
      title: 'Friction', fmu: 'plant',
      controls: [
        ['coulomb_friction1', 0, 10, 0.1], ['breakaway_friction1', 0, 15, 0.1],
        ['stribeck_velocity1', 0, 1, 0.01], ['damping1', 0, 5, 0.05],
        ['coulomb_friction2', 0, 30, 0.5], ['breakaway_friction2', 0, 40, 0.5],
        ['stribeck_velocity2', 0, 1, 0.01], ['damping2', 0, 20, 0.5],
      ],
    },
    {
      title: 'Stops', fmu: 'plant',
      controls: [
        ['stops1'], ['lower1', -3.2, 0, 0.1], ['upper1', 0, 3.2, 0.1], ['restitution1', 0, 1, 0.05],
        ['stop_stiffness1', 0, 2000, 20], ['stop_damping1', 0, 5, 0.1],
        ['stops2'], ['lower2', -0.5, 0, 0.01], ['upper2', 0, 0.5, 0.01], ['restitution2', 0, 1, 0.05],
        ['stop_stiffness2', 0, 20000, 200], ['stop_damping2', 0, 5, 0.1],
      ],
    },
    {
      title: 'Arm', fmu: 'plant',
      controls: [
        ['m1', 0, 10, 0.1], ['m2', 0.1, 10, 0.1], ['I1z', 0, 1, 0.01], ['I2z', 0, 1, 0.01],
        ['l1', 0.1, 1, 0.05], ['lc1', 0, 1, 0.05], ['a', -0.3, 0.3, 0.01], ['g', 0, 20, 0.01],
        ['armature1', 0, 2, 0.05], ['armature2', 0, 10, 0.1],
      ],
    },
    {
      title: 'Payload', fmu: 'plant',
      controls: [
        ['payload_mass', 0, 5, 0.1], ['payload_inertia', 0, 0.2, 0.005],
        ['payload_x', -0.2, 0.2, 0.01], ['payload_z', -0.2, 0.2, 0.01], ['grasp'],
      ],
    },
    {
      title: 'Controller’s gains', fmu: 'controller',
      controls: [
        ['Kp1', 0, 1000, 10], ['Kd1', 0, 100, 1], ['Ki1', 0, 4000, 50], ['tau1_max', 0, 200, 1],
        ['Kp2', 0, 1000, 10], ['Kd2', 0, 100, 1], ['Ki2', 0, 4000, 50], ['f2_max', 0, 200, 1],
        ['sample_time', 0, 0.05, 0.001], ['m2', 0.1, 10, 0.1], ['g', 0, 20, 0.01],
      ],
    },
    {
      title: 'Solver', fmu: 'plant',
      controls: [['solver_method'], ['relative_tolerance', 0, 1e-4, 1e-7], ['max_step', 0, 0.01, 0.0005]],
    },
  ],

  /** Numbers that are shown while it runs: [title, variables of the plant]. */
  shown: [
    ['Motion', ['q1', 'q2', 'dq1', 'dq2', 'ee_x', 'ee_y']],
    ['Energy', ['kinetic_energy', 'potential_energy', 'total_energy', 'actuator_power',
      'friction_power', 'impact_loss']],
    ['Friction and stops', ['mode1', 'mode2', 'friction1', 'friction2', 'stop_force1', 'stop_force2',
      'event_count', 'last_event_time']],
    ['Solver', ['solver_steps', 'solver_rhs_evaluations', 'solver_restarts', 'solver_failed_steps',
      'solver_last_step', 'solver_last_order', 'effective_relative_tolerance']],
  ],

  /** Plots: title, least range of the values, variables of the plant of one unit. */
  charts: [
    ['q1', 1, ['q1']], ['q2', 0.1, ['q2']], ['dq1', 1, ['dq1']], ['dq2', 0.1, ['dq2']],
    ['Energy', 1, ['kinetic_energy', 'potential_energy', 'total_energy']],
  ],

  /** What mode1 and mode2 mean. */
  modes: {'-1': 'slides backward', 0: 'held', 1: 'slides forward', 2: 'no friction'},
};
