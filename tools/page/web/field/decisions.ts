// A number near a prediction, as decisions (engine/splat/src/vgs/decisions.rs). All numbers are whole and
// below 2^53.
import { Decoder, Tree } from './coder.ts';

/** Predictions and sizes of errors are in parts of this. */
export const POINT = 64;
/** Largest size of a number. */
export const LARGEST = 2 ** 28;
/**
 * Contexts: the levels of an error, by the number of faces that are not inside, in the region and in its rim;
 * and classes of how far the prediction is from the number of the lattice nearest to it.
 */
const CONTEXTS = 2 * 7 * 32, OFFS = 3;
/** Kinds of decisions; those of the divisions of a cell begin here. */
const KINDS = 24, HALVES = 20, OTHERS = 23;
/** Beyond this many cells, the rest is a number of its own, of so many bits at most. */
const FAR = 18, MOST_BITS = 30;
/** Smallest probability of a decision, in 1/65536. */
const LEAST = 24;

/** What was learned of decisions. */
export class Decisions {
    private readonly bits = new Tree(CONTEXTS * OFFS * KINDS - 1);

    /**
     * Reads a multiple of `step` that is about as far from a prediction as `size` says; NaN if it is larger
     * than any. `context` is what it has in common with others.
     */
    number(input: Decoder, prediction: number, size: number, context: number, step: number): number {
        const nearest = Math.floor((prediction + POINT / 2) / POINT);
        const predicted = Math.min(Math.max(nearest, -LARGEST / 2), LARGEST / 2);
        const centre = Math.floor((predicted + Math.floor(step / 2)) / step) * step;
        // What lies on the side of the prediction is likelier, however that side is called.
        const off = predicted - centre, ahead = off < 0 ? -step : step;
        const node = (context * OFFS + Math.floor(Math.abs(off) * 2 * OFFS / (step + 1))) * KINDS;
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
        const number = centre + (index - Math.floor(side / 2)) * ahead;
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
