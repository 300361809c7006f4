// A voxel's intensity from those before it (engine/splat/src/vgs/voxel.rs, which has the method). All numbers
// are whole and below 2^53, and rounded where the program rounds them.
import type { Vec3 } from '../types.ts';
import type { Decoder } from './coder.ts';
import { Decisions, LARGEST, POINT } from './decisions.ts';
import { FIRST, LARGEST_TERM, TERMS, learn, predict, regression } from './regression.ts';

/** Where a voxel is: neither in the region nor beside it; one of the 26 neighbours of one there; in it. */
export const OUTSIDE = 0, RIM = 1, INSIDE = 2;
/** Neighbours before a voxel, x first, and their weights in means. */
const NEIGHBOURS = [
    [-1, 0, 0, 16], [0, -1, 0, 16], [0, 0, -1, 16], [-1, -1, 0, 6], [1, -1, 0, 6], [-1, 0, -1, 6],
    [1, 0, -1, 6], [0, -1, -1, 6], [0, 1, -1, 6], [-2, 0, 0, 2], [0, -2, 0, 2], [0, 0, -2, 2],
    [-1, -1, -1, 2], [1, -1, -1, 2], [-1, 1, -1, 2], [1, 1, -1, 2], [2, -1, 0, 1], [-2, -1, 0, 1],
];
const COUNT = NEIGHBOURS.length;
const WEIGHTS = Float64Array.from(NEIGHBOURS, (neighbour) => neighbour[3]);
/** Voxels around a slice: as far as neighbours reach. */
const BESIDE = 2;
/** The sides of the tiles that a regression learns in; the first learns in the whole slice. */
const TILES = [Infinity, 24, 10];
/** Size of errors where no neighbour is known. */
const UNKNOWN = 40 * POINT;
/** A difference of the expected size, as a term. */
const UNIT = 256;
/** What is kept of a voxel: its value, and the errors of the prediction and of each regression. */
const PAST = 5;
/** The value of a voxel that is not known. */
const NONE = -(2 ** 31);
const LARGEST_I32 = 2 ** 31 - 1;

/** Reads the voxels of a slab, and learns on the way. */
export class VoxelReader {
    private readonly input: Decoder;
    /** Of the rim, and inside; so are the regressions, of each tile of each kind. */
    private readonly steps: [number, number];
    private readonly regressions = [0, 1].map(() => TILES.map((): (Float64Array | undefined)[] => []));
    private readonly decisions = new Decisions();
    /** The latest three slices, and where the neighbours are in them. */
    private readonly past: Int32Array;
    private readonly row: number;
    private readonly plane: number;
    private slice = -1;
    private readonly away = new Int32Array(COUNT);
    /** Voxels from the sites of a voxel to those at its faces. */
    private readonly faces: number[];
    private readonly across: number[];
    private last = 0;
    private readonly values = new Float64Array(COUNT);
    private readonly terms = new Float64Array(TERMS);
    private readonly errors = new Float64Array(TILES.length);
    /** The regressions that predicted. */
    private readonly used: Float64Array[] = [FIRST, FIRST, FIRST];
    private readonly predictions = new Float64Array(TILES.length);

    /**
     * Creates a reader of slices. The bounds are those of the rim and of what is inside; steps are those from
     * the site of a voxel to the next along x, y, z.
     */
    constructor(input: Decoder, [nx, ny]: Vec3, bounds: [number, number], [sx, sy, sz]: Vec3) {
        this.input = input;
        this.steps = bounds.map((bound) => 2 * bound + 1) as [number, number];
        this.row = nx + 2 * BESIDE;
        this.plane = this.row * (ny + 2 * BESIDE) * PAST;
        this.past = new Int32Array(3 * this.plane).fill(NONE);
        this.faces = [sx, -sx, sy, -sy, sz, -sz];
        this.across = TILES.map((side) => Math.ceil(nx / side));
    }

    /** Begins a slice. */
    next(): void {
        const { plane, row } = this, latest = ++this.slice % 3;
        this.past.fill(NONE, latest * plane, (latest + 1) * plane);
        NEIGHBOURS.forEach(([x, y, z], n) => {
            this.away[n] = ((latest + z + 3) % 3) * plane + (y * row + x) * PAST;
        });
    }

    /** Reads the code of voxel (x, y) of the slice, with its site at `at`; NaN if the bytes are none. */
    read(x: number, y: number, sites: Uint8Array, at: number): number {
        const { past, away, values, terms, errors, predictions, faces } = this;
        const place = ((y + BESIDE) * this.row + x + BESIDE) * PAST, inside = sites[at] === INSIDE ? 1 : 0;
        let weights = 0, mean = this.last, difference = UNKNOWN / 2, error = 0, sum = 0, end = 0;
        errors.fill(0);
        for (let n = 0; n < COUNT; n++) {
            const from = place + away[n], value = values[n] = past[from];
            if (value === NONE) continue;
            const weight = WEIGHTS[n];
            weights += weight;
            sum += weight * value;
            error += weight * past[from + 1];
            for (let k = 0; k < 3; k++) errors[k] += weight * past[from + 2 + k];
        }
        if (weights > 0) {
            mean = Math.floor((sum + Math.floor(weights / 2)) / weights);
            difference = 0;
            for (let n = 0; n < COUNT; n++) {
                if (values[n] !== NONE) difference += WEIGHTS[n] * Math.abs(values[n] - mean);
            }
            difference = Math.floor(difference * POINT / weights);
            error = Math.floor(error / weights);
        } else {
            error = UNKNOWN;
        }
        const step = this.steps[inside];
        const scale = Math.floor(error / 2) + Math.floor(difference / 4) + step * POINT;
        for (let n = 0; n < COUNT; n++) {
            terms[n] = values[n] === NONE ? 0 : termOf(values[n] - mean, scale);
            if (terms[n] !== 0) end = n + 1;
        }
        let open = 0;
        for (let k = 0; k < 6; k++) {
            const is = sites[at + faces[k]] !== INSIDE;
            terms[COUNT + k] = is ? UNIT : 0;
            if (!is) continue;
            open++;
            end = COUNT + k + 1;
        }
        const regressions = this.regressions[inside], { used } = this;
        const first = (regressions[0][0] ??= regression(FIRST));
        for (let k = 0; k < 3; k++) {
            const found = used[k] = (regressions[k][this.tile(k, x, y)] ??= regression(first));
            const by = Math.trunc(predict(found, terms) * scale / UNIT), most = LARGEST * POINT / 2;
            predictions[k] = Math.min(Math.max(mean * POINT + by, -most), most);
        }
        const prediction = this.blend();
        const context = (open + (inside ? 0 : 7)) * 32 + level(error);
        const number = this.decisions.number(this.input, prediction, error, context, step);
        if (Number.isNaN(number)) return number;
        const to = place + this.slice % 3 * this.plane, exact = number * POINT;
        past[to] = number;
        past[to + 1] = Math.min(Math.abs(exact - prediction), LARGEST_I32);
        for (let k = 0; k < 3; k++) {
            past[to + 2 + k] = Math.min(Math.abs(exact - predictions[k]), LARGEST_I32);
        }
        this.last = number;
        const wanted = termOf(number - mean, scale);
        learn(first, terms, end, wanted, FIRST);
        for (let k = 1; k < 3; k++) learn(used[k], terms, end, wanted, first);
        return number;
    }

    private tile(k: number, x: number, y: number): number {
        return Math.floor(y / TILES[k]) * this.across[k] + Math.floor(x / TILES[k]);
    }

    /** The mean of the predictions, weighted by the cubes of the inverses of their errors nearby. */
    private blend(): number {
        const { errors, predictions } = this, [first] = predictions;
        const least = Math.min(errors[0], errors[1], errors[2]) + 100;
        let sum = 0, all = 0;
        for (let k = 0; k < 3; k++) {
            const ratio = Math.floor(least * 1024 / (errors[k] + 100));
            const weight = ((ratio * ratio * ratio) >> 20) + 1;
            sum += weight * (predictions[k] - first);
            all += weight;
        }
        return first + Math.trunc(sum / all);
    }
}

/** A difference from the mean in units of the scale. */
function termOf(difference: number, scale: number): number {
    const term = Math.trunc(difference * (UNIT * POINT) / scale);
    return Math.min(Math.max(term, -LARGEST_TERM), LARGEST_TERM);
}

/** The level of a size, two for each doubling, at most 31. */
function level(size: number): number {
    const n = Math.max(size, 1), bits = 31 - Math.clz32(n);
    return Math.min(2 * bits + (bits > 0 ? (n >> (bits - 1)) & 1 : 0), 31);
}
