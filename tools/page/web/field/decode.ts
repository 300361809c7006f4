// V and O of splats at the voxels of the grid that they were fitted on (engine/render/src/decoded.rs; the
// formulas are those of docs/design/method.md, "The field").
import type { Vec3 } from '../types.ts';
import { MOST_BRICKS, ROWS, SAMPLES, WHOLE, bricksOf, from, spacingOf } from './field.ts';
import type { Field, Progress } from './field.ts';
import { GET_AGAIN, Refusal, tooLarge } from './refusal.ts';
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
const LEAST_WEIGHT = 1.1754944e-38;
/** Most leaps, bricks of 4³ voxels, in the whole box. */
const MOST_LEAPS = 4e6;
/** Most values of splats at voxels: so many and those of each splat. Beyond, decoding would take minutes. */
const MOST_EVALUATIONS = 3e8;
const EVALUATIONS_OF_SPLAT = 8192;

/** No voxel is farther. */
const FAR = 1e9;

/** What a splat is in the space of the grid: columns of a row. */
const MEAN = 0, T_XX = 3, T_XY = 4, T_XZ = 5, T_YY = 6, T_YZ = 7, T_ZZ = 8, AMPLITUDE = 9, AWAY = 10,
    ROW = 11;

interface Footprints {
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

/** Why two sets do not add up to one field, as `join` (engine/splat/src/objects.rs) has it. */
function discord(a: SplatSet, b: SplatSet): string | null {
    const sameGrid = a.grid?.size.every((n, k) => n === b.grid?.size[k]) &&
        a.grid.affine.every((v, k) => v === b.grid?.affine[k]);
    const luminances = [a, b].map(({ unit }) => unit === 'luminance');
    if (luminances[0] !== luminances[1]) return 'one has luminances, the other intensities';
    if (!sameGrid) return 'they were fitted for the voxels of different grids';
    if (a.kernel !== b.kernel) return `the kernel of one is ${a.kernel}, that of the other ${b.kernel}`;
    if (a.epsilon !== b.epsilon) return `ε of one is ${a.epsilon}, that of the other ${b.epsilon}`;
    const [w, other] = [a.occupancyW0, b.occupancyW0];
    return w === other ? null : `w₀ of one is ${w}, that of the other ${other}`;
}

function check(parts: Numbered[]): Grid {
    for (const { set } of parts) {
        if (!set.grid || set.form === 'field') {
            throw new Refusal('The splats were fitted for the field between the voxels too, which a page ' +
                'shows as voxels. Make the page again with the program.');
        }
        const why = discord(parts[0].set, set);
        if (why) throw new Refusal(`The sets of splats cannot be one scene: ${why}. ${GET_AGAIN}`);
    }
    return parts[0].set.grid!;
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

/** The splats of all sets in voxels of the grid. */
function footprintsOf(parts: Numbered[], grid: Grid, background: number): Footprints {
    const total = parts.reduce((sum, { set }) => sum + set.count, 0);
    const rows = new Float64Array(total * ROW), boxes = new Int32Array(total * 6);
    const numbers = new Uint8Array(total);
    const { kernel } = parts[0].set, root = Math.sqrt(SUPPORTS[kernel]);
    const reach = kernel === 'gated' ? GATED_REACH : Infinity, margin = kernel === 'gated' ? 1e-3 : 0;
    let row = 0;
    for (const { set, numbers: pairs } of parts) {
        const numberOf = Uint8Array.from({ length: 256 }, (_, label) => label);
        for (const [label, number] of pairs) numberOf[label] = number;
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

/** First voxel and size of the box around the voxels that splats reach and those beside them. */
function boxAround({ boxes }: Footprints, { size }: Grid): { low: Vec3; size: Vec3 } {
    const low = [FAR, FAR, FAR], high = [-FAR, -FAR, -FAR];
    let evaluations = 0;
    for (let i = 0; i < boxes.length; i += 6) {
        if (boxes[i] > boxes[i + 3]) continue;
        let volume = 0.53;
        for (let k = 0; k < 3; k++) {
            low[k] = Math.min(low[k], boxes[i + k]);
            high[k] = Math.max(high[k], boxes[i + 3 + k]);
            volume *= boxes[i + 3 + k] - boxes[i + k] + 1;
        }
        evaluations += volume;
    }
    if (low[0] > high[0]) return { low: [-1, -1, -1], size: [3, 3, 3] };
    const first = low.map((v) => Math.max(v - 1, -1)) as Vec3;
    const last = high.map((v, k) => Math.min(v + 1, size[k]));
    const extent = last.map((v, k) => v - first[k] + 1) as Vec3;
    const leaps = extent.reduce((product, n) => product * (n + 4) / 4, 1);
    if (leaps > MOST_LEAPS) throw tooLarge(`a box of ${extent.join(' × ')} voxels`);
    const allowed = MOST_EVALUATIONS + EVALUATIONS_OF_SPLAT * (boxes.length / 6);
    if (evaluations > allowed) throw tooLarge('its splats cover too many voxels');
    return { low: first, size: extent };
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

/** The slots of the bricks that splats reach, and the splats of each row of bricks along x. */
function binned(
    { boxes, order }: Footprints, low: Vec3, size: Vec3,
): { bricks: Vec3; slots: Int32Array; used: number; starts: Int32Array; pairs: Int32Array } {
    const bricks = bricksOf(size), [nx, ny, nz] = bricks;
    const slots = new Int32Array(nx * ny * nz).fill(-1), starts = new Int32Array(ny * nz + 1);
    const splats = order.filter((i) => boxes[i * 6] <= boxes[i * 6 + 3]), range = new Int32Array(6);
    for (let n = 0; n < splats.length; n++) {
        bricksOfBox(boxes, splats[n] * 6, 1, low, size, range);
        for (let z = range[2]; z <= range[5]; z++) {
            for (let y = range[1]; y <= range[4]; y++) {
                const row = (z * ny + y) * nx;
                slots.fill(0, row + range[0], row + range[3] + 1);
            }
        }
        bricksOfBox(boxes, splats[n] * 6, 0, low, size, range);
        for (let z = range[2]; z <= range[5]; z++) {
            for (let y = range[1]; y <= range[4]; y++) starts[z * ny + y + 1]++;
        }
    }
    let used = 0;
    for (let i = 0; i < slots.length; i++) if (slots[i] === 0) slots[i] = used++;
    if (used > MOST_BRICKS) throw tooLarge(`${Math.round(used * SAMPLES / 1e6)} million voxels`);
    for (let i = 1; i < starts.length; i++) starts[i] += starts[i - 1];
    const pairs = new Int32Array(starts[starts.length - 1]), next = starts.slice();
    for (let n = 0; n < splats.length; n++) {
        bricksOfBox(boxes, splats[n] * 6, 0, low, size, range);
        for (let z = range[2]; z <= range[5]; z++) {
            for (let y = range[1]; y <= range[4]; y++) pairs[next[z * ny + y]++] = splats[n];
        }
    }
    return { bricks, slots, used, starts, pairs };
}

/** A row of bricks along x: sums at its voxels, x fastest, then y and z of 8 each. */
class Strip {
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

/** Decodes sets that lie on one grid to its voxels. */
export function decodeSplats(parts: Numbered[], progress: Progress): Field {
    const grid = check(parts), { kernel, epsilon, occupancyW0 } = parts[0].set;
    const background = meanBackground(parts);
    const prints = footprintsOf(parts, grid, background), { rows, boxes, numbers } = prints;
    const { low, size } = boxAround(prints, grid);
    const { bricks, slots, used, starts, pairs } = binned(prints, low, size);
    const several = new Set(numbers).size > 1;
    const binary = parts.every(({ set }) => set.form === 'grid-binary');
    const values = new Float32Array(used * SAMPLES).fill(background);
    const occupancies = new Uint16Array(used * SAMPLES);
    const known = new Uint8Array(used * ROWS), there = new Uint8Array(used * ROWS);
    const width = bricks[0] * 8, strip = new Strip(width, [low[0] - 1, 0, 0]), { weights, sums } = strip;
    // Of several objects: Σ w of all, the most that one of them has of it, and that one.
    const all = several ? new Float64Array(width * 64) : weights;
    const most = new Float64Array(several ? width * 64 : 0);
    const winners = new Uint8Array(several ? width * 64 : 0), label = numbers[prints.order[0]];
    const labels = several ? new Uint8Array(used * SAMPLES).fill(label) : null;
    /** Adds what the splats of an object, those of some pairs, gave to the voxels of the strip. */
    const settle = (begin: number, end: number): void => {
        const number = numbers[pairs[begin]];
        let x0 = FAR, x1 = 0;
        for (let p = begin; p < end; p++) {
            x0 = Math.min(x0, boxes[pairs[p] * 6]);
            x1 = Math.max(x1, boxes[pairs[p] * 6 + 3]);
        }
        for (let j = 0; j < 64; j++) {
            const line = j * width + 1 - low[0];
            for (let i = line + x0; i <= line + x1; i++) {
                const w = weights[i];
                all[i] += w;
                if (w > most[i]) {
                    most[i] = w;
                    winners[i] = number;
                }
                weights[i] = 0;
            }
        }
    };
    let least = background, greatest = background;
    /** Takes the sums of a brick of the strip, and clears them. */
    const take = (x: number, y: number, z: number, slot: number): void => {
        const x0 = x * 8 + low[0] - 1, y0 = y * 8 + low[1] - 1, z0 = z * 8 + low[2] - 1;
        for (let j = 0; j < ROWS; j++) {
            const vy = y0 + (j & 7), vz = z0 + (j >> 3);
            const inRow = vy >= 0 && vy < grid.size[1] && vz >= 0 && vz < grid.size[2];
            let at = j * width + x * 8, knownBits = 0, thereBits = 0;
            for (let i = 0; i < 8; i++, at++) {
                const weight = all[at];
                if (weight === 0) continue;
                if (weight >= LEAST_WEIGHT) {
                    const v = Math.fround(background + sums[at] / (weight + epsilon));
                    const to = slot * SAMPLES + j * 8 + i;
                    values[to] = v;
                    knownBits |= 1 << i;
                    if (labels) labels[to] = winners[at];
                    if (inRow && x0 + i >= 0 && x0 + i < grid.size[0]) {
                        if (v < least) least = v;
                        if (v > greatest) greatest = v;
                        // Rounded as the program does, so that the same voxels lie above one half.
                        const rounded = Math.fround(weight);
                        const o = Math.fround(rounded / Math.fround(rounded + occupancyW0));
                        const part = binary ? (o > 0.5 ? WHOLE : 0) : Math.round(o * WHOLE);
                        occupancies[to] = part;
                        if (part > 0) thereBits |= 1 << i;
                    }
                }
                all[at] = sums[at] = 0;
                if (several) most[at] = 0;
            }
            known[slot * ROWS + j] = knownBits;
            there[slot * ROWS + j] = thereBits;
        }
    };
    for (let row = 0; row < starts.length - 1; row++) {
        const y = row % bricks[1], z = Math.floor(row / bricks[1]);
        if (row % 16 === 0) progress('decoding', row / (starts.length - 1));
        strip.move(y * 8 + low[1] - 1, z * 8 + low[2] - 1);
        let begin = starts[row];
        for (let p = begin; p < starts[row + 1]; p++) {
            const i = pairs[p];
            strip.add(kernel, rows, i * ROW, boxes, i * 6);
            if (several && (p + 1 === starts[row + 1] || numbers[pairs[p + 1]] !== numbers[i])) {
                settle(begin, p + 1);
                begin = p + 1;
            }
        }
        for (let x = 0; x < bricks[0]; x++) {
            const slot = slots[row * bricks[0] + x];
            if (slot >= 0) take(x, y, z, slot);
        }
    }
    const spacing = spacingOf(grid.affine);
    const field: Field = {
        size, bricks, slots, values, occupancies, known, there, labels, label,
        faces: [low.map((v) => -v) as Vec3, low.map((v, k) => grid.size[k] - 1 - v) as Vec3],
        worldFromVoxel: from(grid.affine, low),
        edge: (spacing[0] + spacing[1] + spacing[2]) / 3,
        range: [least, greatest],
        background,
        splats: numbers.length,
    };
    if (binary) except(field, low, parts);
    return field;
}

/**
 * Sets the voxels that files list as exceptions; of several files those inside, since another may be inside
 * elsewhere.
 */
function except({ bricks, slots, known, there, occupancies }: Field, low: Vec3, parts: Numbered[]): void {
    for (const { set: { exceptions } } of parts) {
        for (let i = 0; i < exceptions.length; i += 4) {
            if (parts.length > 1 && exceptions[i + 3] === 0) continue;
            const [x, y, z] = [0, 1, 2].map((k) => exceptions[i + k] - low[k] + 1);
            const within = [x, y, z].every((p, k) => p >= 0 && p >> 3 < bricks[k]);
            const slot = within ? slots[((z >> 3) * bricks[1] + (y >> 3)) * bricks[0] + (x >> 3)] : -1;
            const row = slot * ROWS + (z & 7) * 8 + (y & 7), bit = 1 << (x & 7);
            if (slot < 0 || !(known[row] & bit)) continue;
            occupancies[row * 8 + (x & 7)] = exceptions[i + 3] ? WHOLE : 0;
            there[row] = exceptions[i + 3] ? there[row] | bit : there[row] & ~bit;
        }
    }
}

/** The mean of the backgrounds of all splats. */
function meanBackground(parts: Numbered[]): number {
    const first = parts[0].set.background;
    if (parts.every(({ set }) => set.background === first)) return first;
    const count = parts.reduce((sum, { set }) => sum + set.count, 0);
    return Math.fround(parts.reduce((sum, { set }) => sum + set.background * set.count, 0) / count);
}
