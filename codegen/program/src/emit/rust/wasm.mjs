/**
 * Starts the module.
 *
 * @param source bytes, a compiled `WebAssembly.Module`, or what `fetch` gives
 * @returns {Promise<System>}
 */
export async function load(source) {
  const given = await source;
  if (given instanceof WebAssembly.Module) return new System(await WebAssembly.instantiate(given, {}));
  const bytes = typeof Response !== "undefined" && given instanceof Response ? await given.arrayBuffer() : given;
  return new System((await WebAssembly.instantiate(bytes, {})).instance);
}

/** A scene with its parameters, inputs and state, all of them in the memory of the module. */
export class System {
  constructor(instance) {
    this.exports = instance.exports;
  }

  /** Numbers from an address on; to be asked for again after a call, which may move the memory. */
  numbers(at, n) {
    return new Float64Array(this.exports.memory.buffer, at, n);
  }

  get params() {
    return this.numbers(this.exports.params(), this.exports.n_params());
  }

  get inputs() {
    return this.numbers(this.exports.inputs(), this.exports.n_inputs());
  }

  get state() {
    return this.numbers(this.exports.state(), this.exports.n_state());
  }

  /** The time that `integrate` has reached. */
  get time() {
    return this.numbers(this.exports.time(), 1)[0];
  }

  /** Checks the parameters, after they have changed. */
  prepare() {
    this.done(this.exports.prepare());
  }

  /** Throws where the right-hand side has no value. */
  check(t) {
    this.done(this.exports.check(t));
  }

  /** The derivative of the state. */
  rhs(t) {
    this.done(this.exports.rhs(t));
    return this.numbers(this.exports.rates(), this.exports.n_state());
  }

  /** The energy; undefined for a scene that has none. */
  energy(t) {
    this.done(this.exports.evaluate(t));
    return this.numbers(this.exports.energy(), this.exports.n_energy())[0];
  }

  /** The components of all outputs. */
  outputs(t) {
    this.done(this.exports.evaluate(t));
    return this.numbers(this.exports.outputs(), this.exports.n_outputs());
  }

  /** Moves the coordinates that equations give until they satisfy these; without equations the state stays. */
  consistent(t = 0) {
    if (this.exports.consistent) this.done(this.exports.consistent(t));
    return this.state;
  }

  /** Moves the state from one time to another. */
  integrate(t, t_end, { rtol = 1e-9, atol = 1e-12 } = {}) {
    this.done(this.exports.integrate(t, t_end, rtol, atol));
    return this.state;
  }

  done(code) {
    if (code === 0) return;
    const { memory, message, n_message } = this.exports;
    throw new Error(new TextDecoder().decode(new Uint8Array(memory.buffer, message(), n_message())));
  }
}
