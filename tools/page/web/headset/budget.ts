// Which quality level the next frame takes, so that frames come at the display's rate. As
// engine/render/src/budget, but a page learns only when frames came, not how long the device worked: a frame
// in time says nothing of the room that is left, so a better level is tried, and ever later where that was in
// vain.

/** Frames that are looked back on. */
const WINDOW = 32;
/** Longest frame in time, in periods: a display shows a late one a whole period later. */
export const LATE = 1.5;
/** A pause longer than this, ms, is not a frame: the headset was off, or its menu was shown. */
const PAUSE = 1000;
/** Part of the period that a level should take. */
const AIM = 0.85;
/** Frames before a better level is tried, at first and at most. */
const PATIENCE = [60, 60 << 7] as const;

export class Budget {
    level: number;
    #times: number[] = [];
    /** Frames since the level was chosen. */
    #age = 0;
    #climbed = false;
    readonly #patience: number[];
    readonly #costs: number[];

    /** `costs`: of the levels, falling; `level`: the one to begin with. */
    constructor(costs: number[], level: number) {
        this.#costs = costs;
        this.level = level;
        this.#patience = costs.map(() => PATIENCE[0]);
    }

    /** Takes the time between two frames, and the display's period, ms. */
    frame(ms: number, period: number): void {
        if (ms > PAUSE) return;
        this.#age++;
        this.#times.push(ms);
        if (this.#times.length > WINDOW) this.#times.shift();
        const late = this.#times.filter((time) => time > LATE * period);
        const latest = this.#times.slice(-2);
        if (latest.length === 2 && latest.every((time) => time > LATE * period)) {
            this.#down(Math.min(...latest), period);
        } else if (late.length > 2) {
            this.#down(Math.min(...late), period);
        } else if (this.level > 0 && this.#age >= this.#patience[this.level - 1]) {
            this.#change(this.level - 1, true);
        }
    }

    #down(ms: number, period: number): void {
        const last = this.#costs.length - 1;
        if (this.level === last) return;
        const soon = this.#climbed && this.#age <= 2 * this.#patience[this.level];
        if (soon) this.#patience[this.level] = Math.min(2 * this.#patience[this.level], PATIENCE[1]);
        // The level from which this one was tried was in time.
        const share = soon ? 1 : (AIM * period) / ms;
        const fits = this.#costs.findIndex((cost) => cost <= share * this.#costs[this.level]);
        this.#change(Math.max(fits < 0 ? last : fits, this.level + 1), false);
    }

    #change(level: number, climbed: boolean): void {
        // A level that has held for long is trusted again.
        if (this.#climbed && this.#age > 2 * this.#patience[this.level]) {
            this.#patience[this.level] = Math.max(this.#patience[this.level] / 2, PATIENCE[0]);
        }
        this.level = level;
        this.#climbed = climbed;
        this.#age = 0;
        this.#times = [];
    }
}
