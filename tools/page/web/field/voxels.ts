// The reader of decoded fields (src/voxels.rs has the format, and the reasons for it).
import type { Affine, Vec3 } from '../types.ts';
import { Around, bricksNear, eachBrick, occupied } from './bricks.ts';
import { Decoder, Tree, bitsOf } from './coder.ts';
import { MOST_BRICKS, ROWS, SAMPLES, WHOLE, bricksOf } from './field.ts';
import type { Field, Progress } from './field.ts';
import { GET_AGAIN, Refusal, tooLarge } from './refusal.ts';
import { crc32 } from './vgs.ts';

const MARK = [0x89, 0x56, 0x47, 0x46, 0x0d, 0x0a, 0x1a, 0x0a];
const VERSION = 1;
/** Bytes before the labels. */
const HEAD = 154;
const MOST_LEAPS = 4e6;
const PREDICTORS = 7;
const MOST_ERROR = 1 << 20;
/** What stands for the error nearby where nothing is. */
const UNKNOWN_ERROR = 100;
const V_CONTEXTS = 48;
const O_CONTEXTS = 10;
/** Bits of a number below its highest that have models. */
const MODELLED_BITS = 2;
/** Voxels around a slice, so that those beside its faces need no question. */
const PAD = 2;
/** Stands for V that is not known. */
const NONE = -0x80000000;

function damaged(): Refusal {
    return new Refusal(`The field of this page is damaged. ${GET_AGAIN}`);
}

const trees = (last: number, count: number): Tree[] => Array.from({ length: count }, () => new Tree(last));

/** What predictions leave. */
class Residuals {
    private readonly bits: Tree[];
    private readonly signs: Tree[];
    private readonly next: Tree[];

    constructor(contexts: number) {
        this.bits = trees(31, contexts);
        this.signs = trees(1, contexts);
        this.next = trees((1 << MODELLED_BITS) - 1, 32);
    }

    read(context: number, input: Decoder): number {
        const bits = input.number(this.bits[context]);
        if (bits === 0) return 0;
        const negative = input.number(this.signs[context]) === 1, below = input.number(this.next[bits]);
        let rest = Math.max(bits - 1 - MODELLED_BITS, 0), size = (1 << (bits - 1 - rest)) | below;
        while (rest > 0) {
            const piece = Math.min(rest, 16);
            rest -= piece;
            size = size * (1 << piece) + input.even(1 << piece);
        }
        return negative ? -size : size;
    }
}

/** Slots of the bricks that have anything in them. */
function readBricks([nx, ny, nz]: Vec3, input: Decoder): Int32Array {
    const slots = new Int32Array(nx * ny * nz).fill(-1), models = trees(1, 8);
    let used = 0;
    eachBrick([nx, ny, nz], (x, y, z, number) => {
        const flag = (there: boolean, back: number): number => (there && slots[number - back] >= 0 ? 1 : 0);
        const context = flag(x > 0, 1) * 4 + flag(y > 0, nx) * 2 + flag(z > 0, nx * ny);
        if (input.number(models[context]) === 1) slots[number] = used++;
    });
    return slots;
}

/**
 * Calls `each` with every brick that has a slot and a row of voxels in a slice: its slot, the row in it, and
 * the box's x, y.
 */
function eachRow(
    { size, bricks, slots }: Field, z: number,
    each: (slot: number, row: number, x: number, y: number) => void,
): void {
    for (let y = 0; y < size[1]; y++) {
        const line = (((z + 1) >> 3) * bricks[1] + ((y + 1) >> 3)) * bricks[0];
        for (let x = 0; x < bricks[0]; x++) {
            if (slots[line + x] >= 0) each(slots[line + x], ((z + 1) & 7) * 8 + ((y + 1) & 7), x * 8 - 1, y);
        }
    }
}

/** Reads O, and labels where anything is. */
function readOccupancies(field: Field, soft: boolean, labels: Uint8Array, input: Decoder): void {
    const { size, occupancies, there } = field;
    const width = size[0] + 2 * PAD, places = width * (size[1] + 2 * PAD);
    const models = trees(1, 1 << 10), left = new Residuals(O_CONTEXTS);
    const same = trees(1, 4), other = new Tree(labels.length - 1);
    let here = new Uint8Array(places), before = new Uint8Array(places);
    let names = new Uint8Array(places), namesBefore = new Uint8Array(places);
    let last = 0;
    for (let z = 0; z < size[2]; z++) {
        eachRow(field, z, (slot, row, first, y) => {
            let bits = 0;
            for (let i = 0; i < 8; i++) {
                const x = first + i, at = (y + PAD) * width + x + PAD;
                if (x < 0 || x >= size[0]) continue;
                const w = here[at - 1], n = here[at - width], b = before[at];
                const context = (w && 512) | (here[at - 2] && 256) |
                    (here[at - width - 1] && 128) | (n && 64) | (here[at - width + 1] && 32) |
                    (b && 16) | (before[at - 1] && 8) | (before[at + 1] && 4) |
                    (before[at - width] && 2) | (before[at + width] && 1);
                if (input.number(models[context]) === 0) continue;
                const count = (w && 1) + (n && 1) + (b && 1);
                let o = 255;
                if (soft) {
                    const spread = Math.max(w, n, b) - Math.min(w || 255, n || 255, b || 255);
                    const predicted = count > 0 ? Math.floor((2 * (w + n + b) + count) / (2 * count)) : 128;
                    o = predicted + left.read(count > 0 ? 1 + bitsOf(spread) : 0, input);
                    if (o < 1 || o > 255) throw damaged();
                }
                let name = 0;
                if (labels.length > 1) {
                    const predicted = w ? names[at - 1] : n ? names[at - width] : b ? namesBefore[at] : last;
                    const agree = (w && names[at - 1] === predicted ? 1 : 0) +
                        (n && names[at - width] === predicted ? 1 : 0) +
                        (b && namesBefore[at] === predicted ? 1 : 0);
                    name = input.number(same[agree]) === 1 ? predicted : input.number(other);
                    if (name >= labels.length) throw damaged();
                    names[at] = last = name;
                    field.labels![slot * SAMPLES + row * 8 + i] = labels[name];
                }
                here[at] = o;
                occupancies[slot * SAMPLES + row * 8 + i] = o * (WHOLE / 255);
                bits |= 1 << i;
            }
            there[slot * ROWS + row] = bits;
        });
        if (input.isBeyond) throw damaged();
        [here, before, names, namesBefore] = [before.fill(0), here, namesBefore, names];
    }
}

/** Notes where V is known: where anything is, and in the 26 voxels around. */
function markKnown(field: Field): void {
    const { bricks, slots, there } = field, around = new Around(field);
    eachBrick(bricks, (x, y, z, number) => {
        const slot = slots[number];
        if (slot < 0) return;
        around.move(x, y, z);
        around.near(there, field.known!.subarray(slot * ROWS, (slot + 1) * ROWS));
    });
}

/** What is known of a slice: V in steps, how wrong each predictor was, and how wrong all were together. */
class Slice {
    readonly steps: Int32Array;
    readonly errors: Int32Array;
    readonly error: Int32Array;

    constructor(places: number) {
        this.steps = new Int32Array(places).fill(NONE);
        this.errors = new Int32Array(places * PREDICTORS);
        this.error = new Int32Array(places);
    }

    clear(): this {
        this.steps.fill(NONE);
        this.errors.fill(0);
        this.error.fill(0);
        return this;
    }
}

/** Predicts V at a place from the voxels before it. */
class Predictor {
    readonly guesses = new Float64Array(PREDICTORS);
    weighted = 0;
    context = 0;
    private readonly width: number;

    constructor(width: number) {
        this.width = width;
    }

    guess(at: number, here: Slice, before: Slice, earlier: Slice, last: number): void {
        const { width, guesses } = this, a = here.steps, p = before.steps;
        const w = a[at - 1], n = a[at - width], b = p[at];
        const wn = a[at - width - 1], wb = p[at - 1], nb = p[at - width], wnb = p[at - width - 1];
        const count = (w !== NONE ? 1 : 0) + (n !== NONE ? 1 : 0) + (b !== NONE ? 1 : 0);
        const sum = (w !== NONE ? w : 0) + (n !== NONE ? n : 0) + (b !== NONE ? b : 0);
        const mean = count > 0 ? Math.floor((2 * sum + count) / (2 * count)) : last;
        this.pair(0, mean, w, a[at - 2]);
        this.pair(1, mean, n, a[at - 2 * width]);
        this.pair(2, mean, b, earlier.steps[at]);
        const whole = count === 3 && wn !== NONE && wb !== NONE && nb !== NONE && wnb !== NONE;
        guesses[6] = whole ? w + n + b - wn - wb - nb + wnb : mean;
        const en = at - width + 1, e = here.errors, q = before.errors;
        let total = 0, weights = 0;
        for (let k = 0; k < PREDICTORS; k++) {
            const i = at * PREDICTORS + k, j = (at - width) * PREDICTORS + k;
            const errors = e[i - PREDICTORS] + e[j] + q[i] + e[j - PREDICTORS] + e[j + PREDICTORS] +
                q[i - PREDICTORS] + q[i + PREDICTORS];
            const wrong = 1 + 2 * errors, weight = 1 / (wrong * wrong);
            total += weight * guesses[k];
            weights += weight;
        }
        this.weighted = Math.floor(total / weights + 0.5);
        const there = count + (wn !== NONE ? 1 : 0) + (a[en] !== NONE ? 1 : 0) + (wb !== NONE ? 1 : 0) +
            (p[at + 1] !== NONE ? 1 : 0);
        const f = here.error, g = before.error;
        const errors = f[at - 1] + f[at - width] + g[at] + f[at - width - 1] + f[en] + g[at - 1] + g[at + 1];
        const error = there > 0 ? Math.floor((2 * errors) / there) : UNKNOWN_ERROR, bits = bitsOf(error);
        this.context = bits < 2 ? bits : 2 * bits - 1 + ((error >> (bits - 2)) & 1);
    }

    /** The guesses along an axis with one and two voxels before. */
    private pair(k: number, mean: number, one: number, two: number): void {
        this.guesses[k] = one !== NONE ? one : mean;
        this.guesses[k + 3] = one === NONE ? mean : two !== NONE ? 2 * one - two : one;
    }
}

/** Reads V where it is known. */
function readValues(field: Field, step: number, input: Decoder, progress: Progress): void {
    const { size, values, known, range: [low] } = field;
    const width = size[0] + 2 * PAD, places = width * (size[1] + 2 * PAD);
    const left = new Residuals(V_CONTEXTS), predictor = new Predictor(width), { guesses } = predictor;
    let here = new Slice(places), before = new Slice(places), earlier = new Slice(places), last = 0;
    const error = (value: number, guess: number): number => Math.min(Math.abs(value - guess), MOST_ERROR);
    for (let z = 0; z < size[2]; z++) {
        progress('decoding', z / size[2]);
        eachRow(field, z, (slot, row, first, y) => {
            const bits = known![slot * ROWS + row];
            for (let i = 0; bits >> i > 0; i++) {
                const x = first + i, at = (y + PAD) * width + x + PAD;
                if (!((bits >> i) & 1) || x < 0 || x >= size[0]) continue;
                predictor.guess(at, here, before, earlier, last);
                last = (predictor.weighted + left.read(predictor.context, input)) | 0;
                here.steps[at] = last;
                here.error[at] = error(last, predictor.weighted);
                const own = at * PREDICTORS;
                for (let k = 0; k < PREDICTORS; k++) here.errors[own + k] = error(last, guesses[k]);
                values[slot * SAMPLES + row * 8 + i] = low + step * last;
            }
        });
        if (input.isBeyond) throw damaged();
        [here, before, earlier] = [earlier.clear(), here, before];
    }
}

/** Gives slots to all bricks near which something is, and moves what was read to them. */
function widened(field: Field): Field {
    const { bricks, slots, labels, background, label } = field;
    const wanted = bricksNear(field, occupied(field.there), 1, 1), count = wanted.length;
    if (count > MOST_BRICKS) throw tooLarge(`${count} bricks of voxels`);
    const all = new Int32Array(slots.length).fill(-1);
    const occupancies = new Uint16Array(count * SAMPLES), there = new Uint8Array(count * ROWS);
    const moved = labels && new Uint8Array(count * SAMPLES).fill(label);
    wanted.forEach((number, slot) => {
        const old = slots[number];
        all[number] = slot;
        if (old < 0) return;
        occupancies.set(field.occupancies.subarray(old * SAMPLES, (old + 1) * SAMPLES), slot * SAMPLES);
        there.set(field.there.subarray(old * ROWS, (old + 1) * ROWS), slot * ROWS);
        if (labels && moved) moved.set(labels.subarray(old * SAMPLES, (old + 1) * SAMPLES), slot * SAMPLES);
    });
    return {
        ...field, bricks, slots: all, occupancies, there, labels: moved,
        values: new Float32Array(count * SAMPLES).fill(background), known: new Uint8Array(count * ROWS),
    };
}

/** Reads a field. `numbers` are those of the objects of its labels. */
export function readVoxels(bytes: Uint8Array, numbers: [number, number][], progress: Progress): Field {
    if (bytes.length <= HEAD || MARK.some((byte, i) => bytes[i] !== byte)) throw damaged();
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const version = view.getUint32(8, true);
    if (version !== VERSION) {
        throw new Refusal(`The field has version ${version} of its format, and this page reads version ` +
            `${VERSION}. ${GET_AGAIN}`);
    }
    const size = [16, 20, 24].map((at) => view.getUint32(at, true)) as Vec3;
    const worldFromVoxel = Array.from({ length: 12 }, (_, i) => view.getFloat64(28 + 8 * i, true)) as Affine;
    const range: [number, number] = [view.getFloat32(132, true), view.getFloat32(136, true)];
    const edge = view.getFloat64(124, true);
    const step = view.getFloat64(140, true), background = view.getFloat32(148, true), soft = bytes[152] === 1;
    const end = HEAD + bytes[153] + 1;
    const sound = [...worldFromVoxel, edge, ...range, step, background].every(Number.isFinite) &&
        bytes.length > end &&
        size.every((n) => n > 0) && size.reduce((product, n) => product * (n + 4) / 4, 1) <= MOST_LEAPS;
    if (!sound || crc32(bytes.subarray(16)) !== view.getUint32(12, true)) throw damaged();
    const numberOf = new Map(numbers);
    const labels = bytes.slice(HEAD, end).map((label) => numberOf.get(label) ?? label);
    const input = new Decoder(bytes.subarray(end)), bricks = bricksOf(size);
    const slots = readBricks(bricks, input);
    const used = slots.reduce((most, slot) => Math.max(most, slot + 1), 0);
    if (used > MOST_BRICKS || input.isBeyond) throw damaged();
    const sparse: Field = {
        size, bricks, slots, worldFromVoxel, edge, range, background,
        values: new Float32Array(0),
        known: new Uint8Array(0),
        occupancies: new Uint16Array(used * SAMPLES),
        there: new Uint8Array(used * ROWS),
        labels: labels.length > 1 ? new Uint8Array(used * SAMPLES).fill(labels[0]) : null,
        label: labels[0],
        faces: [[0, 0, 0], size.map((n) => n - 1) as Vec3],
        splats: 0,
    };
    progress('reading', 0.5);
    readOccupancies(sparse, soft, labels, input);
    const field = widened(sparse);
    markKnown(field);
    readValues(field, step, input, progress);
    return field;
}
