// Sums of splats at the voxels of the grid that they were fitted on (the formulas are those of
// docs/design/method.md, "The field").
import type { Vec3 } from '../types.ts';
import { bricksOf, from, spacingOf } from './field.ts';
import type { Field } from './field.ts';
import { tooLarge } from './refusal.ts';
import { inverse } from './vgs.ts';
import type { Grid, Kernel, SplatSet } from './vgs.ts';

/** A set, and the number of the object of each of its labels; one without labels has label 0. */
export interface Numbered {
    set: SplatSet;
    numbers: [number, number][];
}

/** Squared whitened distances at which kernels end. */
const SUPPORTS: Record<Kernel, number> = { compact: 6, gaussian: 9, density: 9, gated: 4.794 * 4.794 };
/** The kernel that is also cut off at a distance from the mean along each axis, voxels. */
const GATED_REACH = 10;
const LN_PEAK_MAX = 40;
/** A sum of w below this counts as nothing, as on devices. */
export const LEAST_WEIGHT = 1.1754944e-38;
/** Most leaps, bricks of 4³ voxels, in the whole box. */
const MOST_LEAPS = 4e6;
/** Most values of splats at voxels: so many and those of each splat. Beyond, decoding would take minutes. */
const MOST_EVALUATIONS = 3e8;
const EVALUATIONS_OF_SPLAT = 8192;

/** No voxel is farther. */
export const FAR = 1e9;

/** What a splat is in the space of the grid: columns of a row. */
const MEAN = 0, T_XX = 3, T_XY = 4, T_XZ = 5, T_YY = 6, T_YZ = 7, T_ZZ = 8, AMPLITUDE = 9, AWAY = 10;
export const ROW = 11;

export interface Footprints {
    rows: Float64Array;
    /**
     * First and last voxel of the grid along x, y, z that each splat reaches; the first behind the last:
     * none.
     */
    boxes: Int32Array;
    /** Number of the object of each splat. */
    numbers: Uint8Array;
    /** Splats by their numbers. */
    order: Int32Array;
}

/**
 * Rounds means as the program does, which keeps them in mm as numbers of 32 bits, and takes them to voxels.
 */
function placer(
    { affine }: SplatSet, grid: Grid,
): (x: number, y: number, z: number, to: Float64Array, at: number) => void {
    const back = inverse(grid.affine);
    const mapped = (m: readonly number[], k: number, x: number, y: number, z: number): number =>
        Math.fround(m[k] * x + m[k + 1] * y + m[k + 2] * z + m[k + 3]);
    return (x, y, z, to, at) => {
        const u = mapped(affine, 0, x, y, z), v = mapped(affine, 4, x, y, z), w = mapped(affine, 8, x, y, z);
        for (let k = 0; k < 3; k++) to[at + k] = mapped(back, k * 4, u, v, w);
    };
}

/**
 * The linear part that takes shapes from the space of a set to voxels of the grid; null if these are the
 * same.
 */
function reshaping({ affine }: SplatSet, grid: Grid): number[] | null {
    if (affine.every((v, k) => v === grid.affine[k])) return null;
    const back = inverse(grid.affine), linear: number[] = [];
    for (let r = 0; r < 3; r++) {
        const [x, y, z] = back.slice(r * 4);
        for (let c = 0; c < 3; c++) linear.push(x * affine[c] + y * affine[4 + c] + z * affine[8 + c]);
    }
    return linear;
}

/**
 * Makes C lower triangular again after a linear map L: the rows of L C by Gram-Schmidt, which never squares
 * widths.
 */
function reshaped(l: number[], C: number[]): number[] {
    const [a, b, c, d, e, f] = C;
    const rows = [0, 3, 6].map((r) =>
        [l[r] * a + l[r + 1] * b + l[r + 2] * d, l[r + 1] * c + l[r + 2] * e, l[r + 2] * f]);
    const dot = (p: number[], q: number[]): number => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    const made: number[] = [], units: number[][] = [];
    for (let row of rows) {
        for (const unit of units) {
            const along = dot(row, unit);
            made.push(along);
            row = row.map((v, k) => v - along * unit[k]);
        }
        const length = Math.sqrt(dot(row, row));
        made.push(length);
        units.push(row.map((v) => v / length));
    }
    return made;
}

/** The set whose kernel, ε and w₀ are those of the field: the first that has splats, if any has. */
export function lead(parts: Numbered[]): SplatSet {
    return (parts.find(({ set }) => set.count > 0) ?? parts[0]).set;
}

/** The number of the object of each label of a set. One of `several` has no other labels. */
export function numbersOf({ numbers }: Numbered, several: boolean): Uint8Array {
    const numberOf = Uint8Array.from({ length: 256 }, (_, label) => (several ? 0 : label));
    for (const [label, number] of numbers) numberOf[label] = number;
    return numberOf;
}

/** The splats of all sets in voxels of the grid. */
export function footprintsOf(parts: Numbered[], grid: Grid, background: number): Footprints {
    const total = parts.reduce((sum, { set }) => sum + set.count, 0);
    const rows = new Float64Array(total * ROW), boxes = new Int32Array(total * 6);
    const numbers = new Uint8Array(total);
    const { kernel } = lead(parts), root = Math.sqrt(SUPPORTS[kernel]);
    const reach = kernel === 'gated' ? GATED_REACH : Infinity, margin = kernel === 'gated' ? 1e-3 : 0;
    let row = 0;
    for (const part of parts) {
        const { set } = part, numberOf = numbersOf(part, parts.length > 1);
        const place = placer(set, grid), linear = reshaping(set, grid), { roots, means } = set;
        for (let i = 0; i < set.count; i++, row++) {
            const at = row * ROW;
            let a = roots[i * 6], b = roots[i * 6 + 1], c = roots[i * 6 + 2];
            let d = roots[i * 6 + 3], e = roots[i * 6 + 4], f = roots[i * 6 + 5];
            if (linear) [a, b, c, d, e, f] = reshaped(linear, [a, b, c, d, e, f]);
            place(means[i * 3], means[i * 3 + 1], means[i * 3 + 2], rows, at + MEAN);
            // The upper triangular T with q = |T d|²: C⁻¹ by Gram-Schmidt over its columns, so that of the
            // terms of q one alone changes along x.
            const x0 = 1 / a, x1 = -b / (a * c), x2 = (b * e - c * d) / (a * c * f);
            const y1 = 1 / c, y2 = -e / (c * f), z2 = 1 / f;
            const xx = Math.sqrt(x0 * x0 + x1 * x1 + x2 * x2), u0 = x0 / xx, u1 = x1 / xx, u2 = x2 / xx;
            const xy = u1 * y1 + u2 * y2, xz = u2 * z2;
            const v0 = -xy * u0, v1 = y1 - xy * u1, v2 = y2 - xy * u2;
            const yy = Math.sqrt(v0 * v0 + v1 * v1 + v2 * v2);
            const w0 = -xz * u0, w1 = -xz * u1, w2 = z2 - xz * u2;
            const yz = (v0 * w0 + v1 * w1 + v2 * w2) / yy;
            rows[at + T_XX] = xx;
            rows[at + T_XY] = xy;
            rows[at + T_XZ] = xz;
            rows[at + T_YY] = yy;
            rows[at + T_YZ] = yz;
            // The product of the diagonal is 1 / det C.
            rows[at + T_ZZ] = 1 / (a * c * f) / (xx * yy);
            const lnPeak = kernel === 'density' ? -Math.log(a * c * f) - 1.5 * Math.log(2 * Math.PI) : 0;
            const peak = Math.exp(Math.min(lnPeak, LN_PEAK_MAX));
            rows[at + AMPLITUDE] = set.opacities[i] * peak;
            rows[at + AWAY] = set.intensities[i] - background;
            numbers[row] = numberOf[set.labels ? set.labels[i] : 0];
            for (let k = 0; k < 3; k++) {
                const variance = k === 0 ? a * a : k === 1 ? b * b + c * c : d * d + e * e + f * f;
                const extent = Math.min(root * Math.sqrt(variance), reach) + margin;
                const mean = rows[at + MEAN + k];
                // Beyond the faces of the grid one voxel counts: for means of neighbours.
                const first = Math.max(Math.ceil(mean - extent), -1);
                const last = Math.min(Math.floor(mean + extent), grid.size[k], FAR);
                if (!(first <= last)) {
                    boxes[row * 6] = FAR + 1;
                    break;
                }
                boxes[row * 6 + k] = first;
                boxes[row * 6 + 3 + k] = last;
            }
        }
    }
    return { rows, boxes, numbers, order: ordered(numbers) };
}

/** Sorts splats by their numbers, and keeps the order of those of one. */
function ordered(numbers: Uint8Array): Int32Array {
    const starts = new Int32Array(257);
    for (const number of numbers) starts[number + 1]++;
    for (let i = 0; i < 256; i++) starts[i + 1] += starts[i];
    const order = new Int32Array(numbers.length);
    numbers.forEach((number, i) => (order[starts[number]++] = i));
    return order;
}

/** Where a box of a grid lies whose first voxel is `low`. */
export function placeIn(grid: Grid, low: Vec3): Pick<Field, 'faces' | 'worldFromVoxel' | 'edge'> {
    const [x, y, z] = spacingOf(grid.affine);
    return {
        faces: [low.map((v) => -v) as Vec3, low.map((v, k) => grid.size[k] - 1 - v) as Vec3],
        worldFromVoxel: from(grid.affine, low),
        edge: (x + y + z) / 3,
    };
}

/** First voxel and size of the box around the voxels that splats reach and those beside them. */
export function boxAround({ boxes }: Footprints, { size }: Grid): { low: Vec3; size: Vec3 } {
    const low = [FAR, FAR, FAR], high = [-FAR, -FAR, -FAR];
    for (let i = 0; i < boxes.length; i += 6) {
        if (boxes[i] > boxes[i + 3]) continue;
        for (let k = 0; k < 3; k++) {
            low[k] = Math.min(low[k], boxes[i + k]);
            high[k] = Math.max(high[k], boxes[i + 3 + k]);
        }
    }
    if (low[0] > high[0]) return { low: [-1, -1, -1], size: [3, 3, 3] };
    const first = low.map((v) => Math.max(v - 1, -1)) as Vec3;
    const last = high.map((v, k) => Math.min(v + 1, size[k]));
    return { low: first, size: last.map((v, k) => v - first[k] + 1) as Vec3 };
}

/** Refuses a box that is too large to be looked through. */
export function limit(size: Vec3): void {
    const leaps = size.reduce((product, n) => product * (n + 4) / 4, 1);
    if (leaps > MOST_LEAPS) throw tooLarge(`a box of ${size.join(' × ')} voxels`);
}

/** Cuts what splats reach down to a box, and refuses what would take too long to sum up. */
export function confine({ boxes }: Footprints, low: Vec3, size: Vec3): void {
    let evaluations = 0;
    for (let i = 0; i < boxes.length; i += 6) {
        let volume = 0.53;
        for (let k = 0; k < 3 && volume > 0; k++) {
            boxes[i + k] = Math.max(boxes[i + k], low[k]);
            boxes[i + 3 + k] = Math.min(boxes[i + 3 + k], low[k] + size[k] - 1);
            volume *= Math.max(boxes[i + 3 + k] - boxes[i + k] + 1, 0);
        }
        if (volume === 0) boxes[i] = FAR + 1;
        evaluations += volume;
    }
    const allowed = MOST_EVALUATIONS + EVALUATIONS_OF_SPLAT * (boxes.length / 6);
    if (evaluations > allowed) throw tooLarge('its splats cover too many voxels');
}

/** Writes the first and last brick along x, y, z that hold voxels of a box, which is `wider` on all sides. */
function bricksOfBox(
    box: Int32Array, at: number, wider: number, low: Vec3, size: Vec3, to: Int32Array,
): void {
    for (let k = 0; k < 3; k++) {
        const first = Math.max(box[at + k] - wider - low[k], 0);
        const last = Math.min(box[at + 3 + k] + wider - low[k], size[k] - 1);
        to[k] = (first + 1) >> 3;
        to[k + 3] = (last + 1) >> 3;
    }
}

/** The slots of the bricks in which splats reach a voxel or one beside it, and how many there are. */
export function slotsOf({ boxes }: Footprints, low: Vec3, size: Vec3): { slots: Int32Array; used: number } {
    const [nx, ny, nz] = bricksOf(size), slots = new Int32Array(nx * ny * nz).fill(-1);
    const range = new Int32Array(6);
    for (let i = 0; i < boxes.length; i += 6) {
        if (boxes[i] > boxes[i + 3]) continue;
        bricksOfBox(boxes, i, 1, low, size, range);
        for (let z = range[2]; z <= range[5]; z++) {
            for (let y = range[1]; y <= range[4]; y++) {
                const row = (z * ny + y) * nx;
                slots.fill(0, row + range[0], row + range[3] + 1);
            }
        }
    }
    let used = 0;
    for (let i = 0; i < slots.length; i++) if (slots[i] === 0) slots[i] = used++;
    return { slots, used };
}

/** The splats of each row of bricks along x, of those given in an order that is kept. */
export function binned(
    { boxes }: Footprints, order: Int32Array, low: Vec3, size: Vec3,
): { starts: Int32Array; pairs: Int32Array } {
    const [, ny, nz] = bricksOf(size), starts = new Int32Array(ny * nz + 1), range = new Int32Array(6);
    const splats = order.filter((i) => boxes[i * 6] <= boxes[i * 6 + 3]);
    const eachRow = (each: (row: number, splat: number) => void): void => splats.forEach((splat) => {
        bricksOfBox(boxes, splat * 6, 0, low, size, range);
        for (let z = range[2]; z <= range[5]; z++) {
            for (let y = range[1]; y <= range[4]; y++) each(z * ny + y, splat);
        }
    });
    eachRow((row) => starts[row + 1]++);
    for (let i = 1; i < starts.length; i++) starts[i] += starts[i - 1];
    const pairs = new Int32Array(starts[starts.length - 1]), next = starts.slice();
    eachRow((row, splat) => (pairs[next[row]++] = splat));
    return { starts, pairs };
}

/** A row of bricks along x: sums at its voxels, x fastest, then y and z of 8 each. */
export class Strip {
    /** Voxels along x. */
    readonly width: number;
    /** Σ w, of the object that is being added if there are several. */
    readonly weights: Float64Array;
    /** Σ w (c - b). */
    readonly sums: Float64Array;
    /** Voxel of the grid at the first place. */
    private readonly origin: Vec3;

    constructor(width: number, origin: Vec3) {
        this.width = width;
        this.weights = new Float64Array(width * 64);
        this.sums = new Float64Array(width * 64);
        this.origin = origin;
    }

    /** Goes to the row of bricks that begins at these y and z. */
    move(y: number, z: number): void {
        this.origin[1] = y;
        this.origin[2] = z;
    }

    /** Adds the splat with this row and box. */
    add(kernel: Kernel, rows: Float64Array, at: number, boxes: Int32Array, box: number): void {
        const { weights, sums, width } = this, [ox, oy, oz] = this.origin, support = SUPPORTS[kernel];
        const mx = rows[at + MEAN], my = rows[at + MEAN + 1], mz = rows[at + MEAN + 2];
        const xx = rows[at + T_XX], xy = rows[at + T_XY], xz = rows[at + T_XZ];
        const yy = rows[at + T_YY], yz = rows[at + T_YZ], zz = rows[at + T_ZZ];
        const amplitude = rows[at + AMPLITUDE], away = rows[at + AWAY];
        const x0 = boxes[box], x1 = boxes[box + 3];
        const y0 = Math.max(boxes[box + 1], oy), y1 = Math.min(boxes[box + 4], oy + 7);
        const z0 = Math.max(boxes[box + 2], oz), z1 = Math.min(boxes[box + 5], oz + 7);
        const compact = kernel === 'compact', gated = kernel === 'gated', inverse = 1 / xx;
        // (1 - q/6)³ of the compact kernel is what is left of 1, less the square of a number that rises
        // evenly along x.
        const unit = compact ? Math.sqrt(1 / support) : 1;
        for (let z = z0; z <= z1; z++) {
            const dz = z - mz, uz = zz * dz, vy = yz * dz, left = support - uz * uz;
            for (let y = y0; y <= y1; y++) {
                const dy = y - my, uy = yy * dy + vy, rest = left - uy * uy;
                if (!(rest > 0)) continue;
                const middle = mx - (xy * dy + xz * dz) * inverse, half = Math.sqrt(rest) * inverse;
                const low = Math.max(Math.ceil(middle - half), x0);
                const high = Math.min(Math.floor(middle + half), x1);
                // Beyond the box, or no numbers, if shapes are absurd.
                if (!(low <= high)) continue;
                const first = low | 0, last = high | 0;
                const step = xx * unit;
                let u = (first - middle) * step, i = ((z - oz) * 8 + y - oy) * width + first - ox;
                const end = i + last - first;
                if (compact) {
                    const part = rest * unit * unit;
                    for (; i <= end; i++, u += step) {
                        const t = part - u * u, w = amplitude * t * t * t;
                        weights[i] += w;
                        sums[i] += w * away;
                    }
                } else {
                    const before = support - rest;
                    for (; i <= end; i++, u += step) {
                        const q = before + u * u;
                        if (q >= support) continue;
                        let w = amplitude * Math.exp(-0.5 * q);
                        if (gated) w /= 1 + Math.exp((Math.sqrt(q + 1e-6) - 1.794) / 0.75);
                        weights[i] += w;
                        sums[i] += w * away;
                    }
                }
            }
        }
    }
}

