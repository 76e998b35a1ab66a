// Values of the charts over the last 30 seconds, in columns.

export const SECONDS = 30;

const CAPACITY = 4096; // 30 s at up to 136 snapshots a second
const MAX_GAP_INTERVALS = 4;

/// Values over time. A row whose values are missing has NaN.
export class History {
  constructor(width) {
    this.columns = Array.from({ length: width }, () => new Float32Array(CAPACITY));
    this.times = new Float64Array(CAPACITY);
    this.isAfterGap = new Uint8Array(CAPACITY);
    this.start = 0;
    this.size = 0;
    this.interval = 0.02;
  }

  /// Appends a row at a time in s; with `isNew`, a gap precedes it.
  push(time, row, isNew) {
    if (this.size === CAPACITY) this.drop();
    const before = this.size > 0 ? this.times[(this.start + this.size - 1) % CAPACITY] : time;
    const step = time - before;
    const isGap = isNew || step > Math.max(0.25, MAX_GAP_INTERVALS * this.interval);
    if (!isGap && step > 0) this.interval += 0.05 * (step - this.interval);
    const at = (this.start + this.size) % CAPACITY;
    this.times[at] = time;
    this.isAfterGap[at] = isGap ? 1 : 0;
    this.columns.forEach((column, index) => {
      column[at] = row[index] ?? NaN;
    });
    this.size += 1;
    while (this.size > 1 && this.times[this.start] < time - SECONDS - 1) this.drop();
  }

  drop() {
    this.start = (this.start + 1) % CAPACITY;
    this.size -= 1;
  }

  /// Calls `each(place, time, isAfterGap)` for the rows, oldest first; `place` is that in the columns.
  forEach(each) {
    for (let k = 0; k < this.size; k += 1) {
      const at = (this.start + k) % CAPACITY;
      each(at, this.times[at], this.isAfterGap[at] === 1);
    }
  }

  last(column) {
    return this.size > 0 ? this.columns[column][(this.start + this.size - 1) % CAPACITY] : NaN;
  }
}
