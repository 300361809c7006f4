// Which quality level holds a frame time (engine/render/src/budget says more of this; pages need less).
import levels from 'quality-levels';

/** Share of what is known of the times before that stays when a new one comes. */
const MEMORY = 0.6;
/** A finer level is taken when it is expected to be well within the frame time. */
const MARGIN = 0.8;

/** Least cost of the level of the first picture. */
const FIRST = 0.2;

/** A quality level: parts of the picture's edges, distance of samples in voxels, time relative to the first one. */
export type Level = (typeof levels)[number];

/** Chooses levels so that frames take no longer than `target`, ms. */
export class Levels {
    readonly target: number;
    /** ms that a frame of the first level is expected to take. */
    #whole: number | null = null;
    /** The first picture should come soon, and be one. */
    #at = levels.findLastIndex((level) => level.cost >= FIRST);

    constructor(target: number) {
        this.target = target;
    }

    get level(): Level {
        return levels[this.#at];
    }

    /** "3 of 7" */
    get name(): string {
        return `${this.#at + 1} of ${levels.length}`;
    }

    /** Notes the time of a frame of the level, ms, and chooses that of the next one. */
    took(ms: number): void {
        const whole = ms / this.level.cost;
        this.#whole = this.#whole === null ? whole : MEMORY * this.#whole + (1 - MEMORY) * whole;
        if (this.level.cost * this.#whole > this.target) {
            while (this.#at < levels.length - 1 && this.level.cost * this.#whole > this.target) this.#at++;
        } else if (this.#at > 0 && levels[this.#at - 1].cost * this.#whole < MARGIN * this.target) {
            this.#at--;
        }
    }
}
