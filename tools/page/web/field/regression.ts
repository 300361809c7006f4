// A linear prediction that is learned on the way (engine/splat/src/vgs/regression.rs). All numbers are whole
// and below 2^53.

/** Terms of a sample. */
export const TERMS = 24;
export const LARGEST_TERM = 2047;
const WEIGHT_ONE = 1 << 16;
const LARGEST_WEIGHT = 4 * WEIGHT_ONE;
const FADE = 32, ROUND = 4, PULL = 1 << 17;
/**
 * Where in a regression are: the products of terms, of which those above the diagonal are kept; the products
 * with what is wanted; the weights; the number of samples.
 */
const WANTED = TERMS * TERMS, WEIGHTS = WANTED + TERMS, SEEN = WEIGHTS + TERMS;

/** Returns a regression that begins with the weights of another one. */
export function regression(home: Float64Array): Float64Array {
    const made = new Float64Array(SEEN + 1);
    for (let k = WEIGHTS; k < SEEN; k++) made[k] = home[k];
    return made;
}

/** The weights before anything is learned: a quarter of each of the three nearest neighbours. */
export const FIRST = new Float64Array(SEEN + 1).fill(WEIGHT_ONE / 4, WEIGHTS, WEIGHTS + 3);

/** Returns the weighted sum of terms. */
export function predict(of: Float64Array, terms: Float64Array): number {
    let sum = 0;
    for (let k = 0; k < TERMS; k++) sum += of[WEIGHTS + k] * terms[k];
    return Math.floor(sum / WEIGHT_ONE);
}

/**
 * Learns what the sum should have been, of terms of which none from `end` on is other than 0. Weights that are
 * not determined are those of `home`.
 */
export function learn(
    of: Float64Array, terms: Float64Array, end: number, sum: number, home: Float64Array,
): void {
    for (let i = 0; i < end; i++) {
        const term = terms[i];
        if (term === 0) continue;
        for (let j = i, at = i * (TERMS + 1); j < end; j++, at++) of[at] += term * terms[j];
        of[WANTED + i] += term * sum;
    }
    const seen = ++of[SEEN];
    if (seen % FADE === 0) for (let i = 0; i < WEIGHTS; i++) of[i] -= Math.floor(of[i] / 8);
    if (seen % ROUND === 0) round(of, home);
}

/** Moves each weight in turn to where it is best while the others stay. */
function round(of: Float64Array, home: Float64Array): void {
    for (let k = 0; k < TERMS; k++) {
        const weight = of[WEIGHTS + k], own = k * TERMS;
        let has = 0;
        for (let j = 0; j < k; j++) has += of[j * TERMS + k] * of[WEIGHTS + j];
        for (let j = k; j < TERMS; j++) has += of[own + j] * of[WEIGHTS + j];
        const lacks = of[WANTED + k] * WEIGHT_ONE - has + PULL * (home[WEIGHTS + k] - weight);
        const best = weight + Math.trunc(lacks / (of[own + k] + PULL));
        of[WEIGHTS + k] = Math.min(Math.max(best, -LARGEST_WEIGHT), LARGEST_WEIGHT);
    }
}
