// A number near a prediction, as decisions (engine/splat/src/vgs/decisions.rs). All numbers are whole and below 2^53.
import { Decoder, Tree } from './coder.ts';

/** Predictions and sizes of errors are in parts of this. */
export const POINT = 64;
/** Largest size of a number. */
export const LARGEST = 2 ** 28;
/** Contexts: the levels of an error, by the number of faces that are not inside, in the region and in its rim. */
const CONTEXTS = 2 * 7 * 32;
/** Kinds of decisions; those of the divisions of a cell begin here. */
const KINDS = 24, HALVES = 20, OTHERS = 23;
/** Beyond this many cells, the rest is a number of its own, of so many bits at most. */
const FAR = 18, MOST_BITS = 30;
/** Smallest probability of a decision, in 1/65536. */
const LEAST = 24;

/** What was learned of decisions. */
export class Decisions {
    private readonly bits = new Tree(CONTEXTS * KINDS - 1);

    /**
     * Reads the number of a lattice of `step` around a prediction, both of which are as far off as `size` says; NaN if it is
     * larger than any. `context` is what it has in common with others.
     */
    number(input: Decoder, prediction: number, size: number, context: number, step: number): number {
        const middle = Math.floor((prediction + POINT / 2) / POINT), node = context * KINDS;
        const centre = Math.min(Math.max(middle, -LARGEST / 2), LARGEST / 2);
        let bits = 0, side = 1;
        while (bits < 26 && step * side * 2 * POINT < size) {
            bits++;
            side *= 2;
        }
        const cell = this.cell(input, node);
        if (!(Math.abs(cell) <= Math.floor(Math.floor(2 * LARGEST / step) / side) + 2)) return NaN;
        let index = cell * side, kind = HALVES + 1 + Math.sign(cell);
        for (let half = side / 2; half >= 1; half /= 2) {
            if (input.decision(this.bits, node + kind, LEAST)) index += half;
            kind = OTHERS;
        }
        const number = centre + (index - Math.floor(side / 2)) * step;
        return Math.abs(number) <= LARGEST ? number : NaN;
    }

    /** Reads how many cells away a number is. */
    private cell(input: Decoder, node: number): number {
        const { bits } = this;
        if (!input.decision(bits, node, LEAST)) return 0;
        const up = input.decision(bits, node + 1, LEAST);
        let far = 1;
        while (far < FAR && input.decision(bits, node + 1 + far, LEAST)) far++;
        if (far === FAR) far += rest(input);
        return up ? far : -far;
    }
}

/** Reads a number that nothing is known of: how many bits it has, and they. */
function rest(input: Decoder): number {
    let bits = 0, read = 1;
    while (input.coin()) if (++bits > MOST_BITS) return NaN;
    for (; bits > 0; bits--) read = read * 2 + input.coin();
    return read - 1;
}
