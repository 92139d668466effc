// A browser's frames, held back while something is to rest.

export class HeldFrames {
  #last = 0;
  /** @type {Map<number, number>} by the number given out, the browser's of the frame that is awaited */
  #awaited = new Map();
  #isHeld;

  /** @param {(time: number) => boolean} isHeld whether nothing is to be painted at a time */
  constructor(isHeld) {
    this.#isHeld = isHeld;
  }

  // As the window's own: the number that it returns cancels the frame, also while it is held.
  requestAnimationFrame(/** @type {FrameRequestCallback} */ paint) {
    const number = ++this.#last;
    const wait = () => this.#awaited.set(number, requestAnimationFrame(come));
    const come = (/** @type {number} */ time) => {
      if (this.#isHeld(time)) return void wait();
      this.#awaited.delete(number);
      paint(time);
    };
    wait();
    return number;
  }

  cancelAnimationFrame(/** @type {number} */ number) {
    cancelAnimationFrame(this.#awaited.get(number) ?? 0);
    this.#awaited.delete(number);
  }
}
