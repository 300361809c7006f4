// A transfer function as a table, as the shaders look it up (engine/transfer/src/table/table.rs, where the reasons stand).
import type { TransferFunction } from '../types.ts';
import { dependsOnGradient, extent, extinctionOf, interpolated, visible } from './function.ts';
import { half } from '../half.ts';

const MIN_LENGTH = 4096;
const MAX_LENGTH = 65536;
const FINEST = 2 ** -22;
const MIN_EXPONENT = -40;
const MAX_INTENSITY = 1e36;
/** Entries of a table of factors of the opacity over the gradient magnitude. */
export const GRADIENT_ENTRIES = 256;

export interface Table {
    /** Intensity of entry 0, and the distance of entries: a power of two. */
    first: number;
    step: number;
    length: number;
    /** Colour in three fractions of 16 bits, and extinction (1/mm) as a half: two words an entry. */
    points: Uint32Array;
    /** ∫τ·rgb and ∫τ from entry 0 on, in units of `integralUnit`: four words an entry. */
    integrals: Uint32Array;
    /** 1/mm times entries. */
    integralUnit: number;
    /** 1 for each entry at which something shows. */
    shows: Uint8Array;
    gradientFactors: Float32Array;
    /** Distance of their entries: intensity over a mean edge of the CT's voxels. */
    gradientStep: number;
}

/** The table of a function for intensities in `range`. Without `integrals` that part stays 0. */
export function tableOf(tf: TransferFunction, range: [number, number], integrals: boolean): Table {
    const [first, step, length] = grid(...span(tf, range));
    const points = new Uint32Array(2 * length);
    const shows = new Uint8Array(length);
    const fraction = (v: number) => Math.round(Math.min(Math.max(Math.fround(v), 0), 1) * 65535);
    for (let i = 0; i < length; i++) {
        const v = first + i * step;
        const [r, g, b] = interpolated(tf.colours, v);
        const extinction = Math.fround(extinctionOf(interpolated(tf.opacities, v)[0]));
        points[2 * i] = fraction(r) | (fraction(g) << 16);
        points[2 * i + 1] = fraction(b) | (half(extinction) << 16);
        shows[i] = extinction > 0 ? 1 : 0;
    }
    const [gradientFactors, gradientStep] = gradientTable(tf);
    const [sums, integralUnit] = integrals ? integralsOf(tf, first, step, length) : [new Uint32Array(4), 1];
    return { first, step, length, points, integrals: sums, integralUnit, shows, gradientFactors, gradientStep };
}

/**
 * For each entry of the first table the number of entries before it at which a function shows something, and at last
 * the number of all (engine/render/src/look.rs).
 */
export function visibleBefore(tables: Table[]): Uint32Array {
    const [first, ...others] = tables;
    const shows = Uint8Array.from(first.shows);
    const last = shows.length - 1;
    const clamped = (i: number) => Math.min(Math.max(i, 0), last);
    for (const table of others) {
        const entry = (i: number) => (table.first + i * table.step - first.first) / first.step;
        table.shows.forEach((there, i) => {
            if (!there) return;
            // The entry holds half a step on both sides; the ends hold all that is beyond.
            const low = i === 0 ? -Infinity : i - 1, high = i + 1 === table.length ? Infinity : i + 1;
            shows.fill(1, clamped(Math.floor(entry(low)) - 1), clamped(Math.ceil(entry(high)) + 1) + 1);
        });
    }
    const before = new Uint32Array(shows.length + 1);
    shows.forEach((there, i) => { before[i + 1] = before[i] + there; });
    return before;
}

/** The range of intensities over which the function changes and is visible, as far as it is in `range`. */
function span(tf: TransferFunction, range: [number, number]): [number, number] {
    const [first, last] = extent(tf);
    const [low, high] = visible(tf) ?? [first, first];
    const inside = (v: number) => Math.min(Math.max(v, range[0], -MAX_INTENSITY), range[1], MAX_INTENSITY);
    return [inside(Number.isFinite(low) ? low : first), inside(Number.isFinite(high) ? high : last)];
}

/** The intensity of the first entry, the step and the number of entries. */
function grid(low: number, high: number): [number, number, number] {
    // One entry more on each side, so that a step of the function at an end has both its sides.
    const first = (step: number) => Math.floor(low / step) - 1;
    const count = (step: number) => Math.ceil(high / step) + 2 - first(step);
    const magnitude = Math.max(Math.abs(low), Math.abs(high));
    let exponent = 0;
    while (count(2 ** exponent) > MAX_LENGTH || magnitude * FINEST > 2 * 2 ** exponent) exponent++;
    while (count(2 ** exponent) < MIN_LENGTH && exponent > MIN_EXPONENT && magnitude * FINEST <= 2 ** (exponent - 1))
        exponent--;
    const step = 2 ** exponent;
    return [first(step) * step, step, Math.max(count(step), MIN_LENGTH)];
}

function gradientTable(tf: TransferFunction): [Float32Array, number] {
    const factors = new Float32Array(GRADIENT_ENTRIES).fill(1);
    const points = tf.gradientOpacities;
    if (!dependsOnGradient(tf)) return [factors, 1];
    const end = points[points.length - 1][1];
    const changes = points.findLastIndex((point) => point[1] !== end);
    const last = changes < 0 ? 0 : points[changes + 1][0];
    const step = last > 0 ? last / (GRADIENT_ENTRIES - 1) : 1;
    return [factors.map((_, i) => interpolated(points, i * step)[0]), step];
}

/** ∫τ·rgb and ∫τ over the entries, in whole numbers of a unit. */
function integralsOf(tf: TransferFunction, first: number, step: number, length: number): [Uint32Array, number] {
    const knots = [...tf.colours, ...tf.opacities].map((point) => point[0]).sort((a, b) => a - b);
    const sums = new Float64Array(4 * length);
    const cell = [0, 0, 0, 0];
    let knot = 0;
    for (let i = 1; i < length; i++) {
        const low = first + (i - 1) * step, high = first + i * step;
        cell.fill(0);
        while (knot < knots.length && knots[knot] <= low) knot++;
        let from = low;
        for (let k = knot; from < high; k++) {
            const to = Math.min(k < knots.length ? knots[k] : high, high);
            if (to > from) addPiece(cell, to - from, side(tf, from, false), side(tf, to, true));
            from = to;
        }
        for (let c = 0; c < 4; c++) sums[4 * i + c] = sums[4 * i - 4 + c] + cell[c] / step;
    }
    const unit = unitOf(sums[4 * length - 1]);
    return [Uint32Array.from(sums, (sum) => Math.round(sum / unit)), unit];
}

/** Colour and opacity, from one side of a step. */
function side(tf: TransferFunction, v: number, below: boolean): number[] {
    return [...interpolated(tf.colours, v, below), ...interpolated(tf.opacities, v, below)];
}

/**
 * Adds the integrals over a stretch on which colour and opacity are straight, by Gauss-Legendre quadrature with three
 * nodes; it is halved first if the logarithm of 1 - α bends too much for that.
 */
function addPiece(sum: number[], width: number, from: number[], to: number[]): void {
    const between = (share: number) => from.map((value, i) => value + (to[i] - value) * share);
    const passing = [from[3], to[3]].map((opacity) => Math.exp(-extinctionOf(opacity)));
    if (Math.max(...passing) > 1.25 * Math.min(...passing)) {
        const middle = between(0.5);
        addPiece(sum, width / 2, from, middle);
        addPiece(sum, width / 2, middle, to);
        return;
    }
    const reach = 0.5 * Math.sqrt(0.6);
    for (const [share, weight] of [[0.5 - reach, 5 / 18], [0.5, 8 / 18], [0.5 + reach, 5 / 18]]) {
        const here = between(share);
        const extinction = extinctionOf(here[3]) * weight * width;
        for (let c = 0; c < 3; c++) sum[c] += here[c] * extinction;
        sum[3] += extinction;
    }
}

/** The smallest power of two in units of which `total` is a number of 32 bits. */
function unitOf(total: number): number {
    if (total <= 0) return 1;
    let unit = 2 ** (Math.floor(Math.log2(total)) - 32);
    while (total / unit > 2 ** 32 - 1.5) unit *= 2;
    return unit;
}
