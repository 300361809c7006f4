// The atlas that the march reads, of a decoded field (engine/render/src/atlas.rs), and the grid of small
// bricks by which it leaps over empty space (engine/render/src/gpu_volume.rs).
import type { Atlas, Vec3 } from '../types.ts';
import { half } from '../half.ts';
import { Around, bricksNear, eachBrick, occupied } from './bricks.ts';
import { ROWS, SAMPLES, WHOLE, bricksOf, from, spacingOf } from './field.ts';
import type { Field, Progress } from './field.ts';
import { tooLarge } from './refusal.ts';

/** Texels of a brick along each axis: its own voxels and an apron of one voxel behind them. */
const APRONED = 9;
/** Voxels along each axis of a brick, its apron and one more on each side. */
const AROUND = 11;
const NOWHERE = 0xffffffff;
/** What stands beside a label that all in its cell has. */
const ALONE = 255;
const PLACE_BITS = 10;
/** Greatest number of texels of the image along an axis. */
const MOST_TEXELS = 2048;
/**
 * A brick is kept if anything is so many voxels before or behind it: what lies a step before that is read in
 * the brick.
 */
const BEFORE = 1, BEHIND = 2;
/** Edge of a small brick along the axis of the shortest voxel edge, as a logarithm to base 2. */
const SMALL_SHIFT = 2;
const BINS = 256;
/** Spans of V that halves hold well. */
const SPANS = [2 ** -4, 2 ** 15];
const HALF_OF_ONE = 0x3c00;

/** Coordinates along x, y, z as one number. */
const packed = (x: number, y: number, z: number): number =>
    (x | (y << PLACE_BITS) | (z << (2 * PLACE_BITS))) >>> 0;

/** Cuts a field down to whole bricks around what is there, with an empty border of at least one voxel. */
function cropped(field: Field, boxes: Int8Array): Field {
    const { bricks, slots } = field, low = [Infinity, Infinity, Infinity], high = [-1, -1, -1];
    eachBrick(bricks, (x, y, z, number) => {
        const box = slots[number] * 6;
        if (box < 0 || boxes[box] > 7) return;
        [x, y, z].forEach((brick, k) => {
            low[k] = Math.min(low[k], brick * 8 + boxes[box + k]);
            high[k] = Math.max(high[k], brick * 8 + boxes[box + 3 + k]);
        });
    });
    if (high[0] < 0) return { ...field, size: [3, 3, 3], bricks: [1, 1, 1], slots: Int32Array.of(-1) };
    // Place p of a brick is voxel p - 1 of the box.
    const first = low.map((p) => Math.max((p - 2) >> 3, 0)) as Vec3, voxel = first.map((n) => n * 8) as Vec3;
    const size = high.map((p, k) => p + 1 - voxel[k]) as Vec3, count = bricksOf(size);
    const kept = new Int32Array(count[0] * count[1] * count[2]).fill(-1);
    eachBrick(count, (x, y, z, number) => {
        const [X, Y, Z] = [x + first[0], y + first[1], z + first[2]];
        const within = X < bricks[0] && Y < bricks[1] && Z < bricks[2];
        if (within) kept[number] = slots[(Z * bricks[1] + Y) * bricks[0] + X];
    });
    return {
        ...field, size, bricks: count, slots: kept,
        faces: field.faces.map((face) => face.map((v, k) => v - voxel[k])) as [Vec3, Vec3],
        worldFromVoxel: from(field.worldFromVoxel, voxel),
    };
}

/** Rows of bits around a brick, 10 along y and 10 along z: what is there, and what is known. */
const thereRows = new Uint16Array(100), knownRows = new Uint16Array(100);

/** Gives voxels whose V is not known, beside what is there, the mean of those beside them. */
function fillIn(field: Field, known: Uint8Array, around: Around, slot: number): void {
    const { there, values } = field;
    let any = 0;
    for (let i = 0; i < 100; i++) {
        any |= thereRows[i] = around.row(there, i % 10 - 1, Math.floor(i / 10) - 1, 1);
    }
    if (any === 0) return;
    for (let i = 0; i < 100; i++) knownRows[i] = around.row(known, i % 10 - 1, Math.floor(i / 10) - 1, 1);
    for (let j = 0; j < ROWS; j++) {
        const y = j & 7, z = j >> 3;
        let near = 0;
        for (let k = z * 10 + y; k < z * 10 + y + 30; k += 10) {
            near |= thereRows[k] | thereRows[k + 1] | thereRows[k + 2];
        }
        const wanted = ((near | (near << 1) | (near >> 1)) >> 1) & 255 & ~known[slot * ROWS + j];
        for (let x = 0; wanted >> x > 0; x++) {
            if (!((wanted >> x) & 1)) continue;
            let sum = 0, count = 0;
            for (let n = 0; n < 27; n++) {
                const dx = n % 3 - 1, dy = Math.floor(n / 3) % 3 - 1, dz = Math.floor(n / 9) - 1;
                if (!((knownRows[(z + dz + 1) * 10 + y + dy + 1] >> (x + dx + 1)) & 1)) continue;
                sum += values[around.at(x + dx, y + dy, z + dz)];
                count++;
            }
            if (count > 0) values[slot * SAMPLES + j * 8 + x] = sum / count;
        }
    }
}

/** Holds V beyond the faces of the grid as it is there. */
function hold(
    { faces: [low, high], values }: Field, _: Uint8Array, around: Around, slot: number, first: Vec3,
): void {
    const [x0, y0, z0] = first.map((v, k) => low[k] - v), [x1, y1, z1] = first.map((v, k) => high[k] - v);
    if (x0 <= 0 && y0 <= 0 && z0 <= 0 && x1 >= 7 && y1 >= 7 && z1 >= 7) return;
    for (let i = 0; i < SAMPLES; i++) {
        const x = Math.min(Math.max(i & 7, x0), x1), y = Math.min(Math.max((i >> 3) & 7, y0), y1);
        const z = Math.min(Math.max(i >> 6, z0), z1);
        // The box reaches one voxel beyond the faces: what is there is in this brick or in one beside it.
        const beside = x >= -8 && y >= -8 && z >= -8 && x < 16 && y < 16 && z < 16;
        const face = beside ? around.at(x, y, z) : -1;
        if (face >= 0) values[slot * SAMPLES + i] = values[face];
    }
}

/** The eight texels of the cell from each texel of a brick on; those beyond the brick are its last ones. */
const CORNERS = Int16Array.from({ length: APRONED ** 3 * 8 }, (_, i) => {
    const texel = i >> 3, at = [texel % 9, Math.floor(texel / 9) % 9, Math.floor(texel / 81)];
    const [x, y, z] = at.map((v, k) => Math.min(v + ((i >> k) & 1), 8));
    return (z * 9 + y) * 9 + x;
});

/**
 * Gives texels at which nothing is a label beside them, and tells with `alone` in which cells there is no
 * other. `there` is 1 where something is.
 */
function cells(labels: Uint8Array, there: Uint8Array, alone: Uint8Array): void {
    const given = there.slice(), own = labels.slice();
    for (let i = 0; i < labels.length; i++) {
        let first = -1, same = true;
        for (let c = i * 8; c < i * 8 + 8; c++) {
            const j = CORNERS[c];
            if (!there[j]) continue;
            if (first < 0) first = own[j];
            same &&= own[j] === first;
        }
        if (first < 0 || !same) continue;
        for (let c = i * 8; c < i * 8 + 8; c++) {
            const j = CORNERS[c];
            if (!given[j]) labels[j] = first;
            given[j] = 1;
        }
    }
    for (let i = 0; i < labels.length; i++) {
        alone[i] = ALONE;
        for (let c = i * 8; c < i * 8 + 8; c++) if (labels[CORNERS[c]] !== labels[i]) alone[i] = 0;
    }
}

/** Bricks along the axes of an atlas, as nearly a cube as possible. */
function atlasBricks(count: number): Vec3 {
    const most = Math.floor(MOST_TEXELS / APRONED);
    const x = Math.min(Math.max(Math.ceil(Math.cbrt(count) - 1e-9), 1), most);
    const y = Math.min(Math.ceil(count / x), x), z = Math.ceil(count / (x * y));
    if (z > most) throw tooLarge(`${count} bricks of voxels`);
    return [x, y, z];
}

/** Halves as whole numbers in the same order. */
const inOrder = (bits: number): number => (bits & 0x8000 ? -(bits & 0x7fff) : bits);

/** The number that a half in order stands for. */
function ofOrder(order: number): number {
    const bits = Math.abs(order), exponent = bits >> 10, part = (bits & 0x3ff) / 1024;
    return Math.sign(order) * (exponent ? (1 + part) * 2 ** (exponent - 15) : part * 2 ** -14);
}

/** What is read for places in small bricks and up to a voxel away. */
class Intervals {
    readonly shift: Vec3;
    readonly bricks: Vec3;
    readonly intervals: Float32Array;

    constructor(size: Vec3, spacing: Vec3) {
        const shortest = Math.min(...spacing);
        const shift = (mm: number): number => SMALL_SHIFT - Math.round(Math.log2(mm / shortest));
        this.shift = spacing.map((mm) => Math.min(Math.max(shift(mm), 1), SMALL_SHIFT)) as Vec3;
        this.bricks = size.map((n, k) => Math.ceil((n + 1) / (1 << this.shift[k]))) as Vec3;
        this.intervals = new Float32Array(2 * this.bricks[0] * this.bricks[1] * this.bricks[2]);
        for (let i = 0; i < this.intervals.length; i += 2) {
            this.intervals[i] = Infinity;
            this.intervals[i + 1] = -Infinity;
        }
    }

    /**
     * Takes the block around the brick at these coordinates: halves of V in order, and a row of bits where
     * something is.
     */
    take(at: Vec3, orders: Int16Array, there: Uint16Array, value: (order: number) => number): void {
        const { shift, bricks, intervals } = this;
        const [nx, ny, nz] = shift.map((s) => 8 >> s), [ex, ey, ez] = shift.map((s) => (1 << s) + 3);
        for (let n = 0; n < nx * ny * nz; n++) {
            const x = n % nx, y = Math.floor(n / nx) % ny, z = Math.floor(n / (nx * ny));
            const X = at[0] * nx + x, Y = at[1] * ny + y, Z = at[2] * nz + z;
            if (X >= bricks[0] || Y >= bricks[1] || Z >= bricks[2]) continue;
            const x0 = x << shift[0], y0 = y << shift[1], z0 = z << shift[2], bits = ((1 << ex) - 1) << x0;
            let least = 0x7fff, greatest = -0x7fff, any = 0;
            for (let k = z0; k < z0 + ez; k++) {
                for (let j = y0; j < y0 + ey; j++) any |= there[k * AROUND + j] & bits;
            }
            if (any === 0) continue;
            for (let k = z0; k < z0 + ez; k++) {
                for (let j = y0; j < y0 + ey; j++) {
                    const row = (k * AROUND + j) * AROUND + x0;
                    for (let i = row; i < row + ex; i++) {
                        if (orders[i] < least) least = orders[i];
                        if (orders[i] > greatest) greatest = orders[i];
                    }
                }
            }
            const to = 2 * ((Z * bricks[1] + Y) * bricks[0] + X);
            intervals[to] = value(least);
            intervals[to + 1] = value(greatest);
        }
    }
}

/** Middle and scale with which halves hold V best where something is. */
function fitting({ values, occupancies, background }: Field): { middle: number; scale: number } {
    let least = Infinity, greatest = -Infinity;
    for (let i = 0; i < values.length; i++) {
        if (occupancies[i] === 0) continue;
        least = Math.min(least, values[i]);
        greatest = Math.max(greatest, values[i]);
    }
    if (least > greatest) least = greatest = background;
    const span = greatest - least, within = Math.min(Math.max(span, SPANS[0]), SPANS[1]);
    const scale = span > 0 ? 2 ** Math.ceil(Math.log2(span / within)) : 1;
    return { middle: Math.fround(least + span / 2), scale };
}

/** Numbers of voxels with O above one half over equal steps of the range, of each object. */
function histogramsOf(
    { slots, occupancies, values, labels, label, range: [low, high] }: Field, boxes: Int8Array,
): Map<number, Uint32Array> {
    const found = new Map<number, Uint32Array>(), perUnit = BINS / (high - low || 1);
    for (const slot of slots) {
        if (slot < 0 || boxes[slot * 6] > 7) continue;
        for (let i = slot * SAMPLES; i < (slot + 1) * SAMPLES; i++) {
            if (occupancies[i] * 2 <= WHOLE) continue;
            const number = labels ? labels[i] : label;
            let bins = found.get(number);
            if (!bins) found.set(number, (bins = new Uint32Array(BINS)));
            bins[Math.min(Math.max(Math.floor((values[i] - low) * perUnit), 0), BINS - 1)]++;
        }
    }
    return found;
}

/** Copies what is known of a brick and around it. */
class Copier {
    readonly orders = new Int16Array(AROUND ** 3);
    readonly there = new Uint16Array(AROUND ** 2);
    readonly labels = new Uint8Array(APRONED ** 3);
    readonly labelled = new Uint8Array(APRONED ** 3);
    private readonly around: Around;
    private readonly field: Field;
    /** V of each voxel of the field as a half in order, and that of the background. */
    private readonly all: Int16Array;
    private readonly empty: number;

    constructor(field: Field, around: Around, middle: number, scale: number) {
        const { values, background } = field, toHalf = 1 / scale;
        this.field = field;
        this.around = around;
        this.empty = inOrder(half((background - middle) * toHalf));
        this.all = new Int16Array(values.length).fill(this.empty);
        for (let i = 0; i < values.length; i++) {
            if (values[i] !== background) this.all[i] = inOrder(half((values[i] - middle) * toHalf));
        }
    }

    /** V of the brick and around it; returns whether something is there. */
    copy(): boolean {
        const { around, all, empty, orders } = this, { slots } = around;
        let any = 0;
        for (let k = 0, n = 0; k < AROUND; k++) {
            for (let j = 0; j < AROUND; j++, n += AROUND) {
                any |= this.there[k * AROUND + j] = around.row(this.field.there, j - 1, k - 1, 2) >> 1;
                const first = ((k + 7) >> 3) * 9 + ((j + 7) >> 3) * 3,
                    row = ((k + 7) & 7) * 64 + ((j + 7) & 7) * 8;
                const left = slots[first], right = slots[first + 2] * SAMPLES + row;
                const own = slots[first + 1] * SAMPLES + row;
                orders[n] = left < 0 ? empty : all[left * SAMPLES + row + 7];
                if (own < 0) orders.fill(empty, n + 1, n + 9);
                else for (let i = 0; i < 8; i++) orders[n + 1 + i] = all[own + i];
                orders[n + 9] = right < 0 ? empty : all[right];
                orders[n + 10] = right < 0 ? empty : all[right + 1];
            }
        }
        return any !== 0;
    }

    /** Writes V and O of the texels from place `corner` of the image on. */
    write(texels: Uint16Array, corner: number, dims: Vec3): void {
        const { around: { slots }, orders } = this, { occupancies } = this.field;
        for (let k = 0; k < APRONED; k++) {
            for (let j = 0; j < APRONED; j++) {
                const first = 9 + (k >> 3) * 9 + 3 + (j >> 3) * 3 + 1, row = (k & 7) * 64 + (j & 7) * 8;
                const own = slots[first] * SAMPLES + row, right = slots[first + 1] * SAMPLES + row;
                const line = ((k + 1) * AROUND + j + 1) * AROUND + 1,
                    to = 2 * (corner + (k * dims[1] + j) * dims[0]);
                for (let i = 0; i < APRONED; i++) {
                    const order = orders[line + i], at = i < 8 ? own : right;
                    const o = at < 0 ? 0 : occupancies[at + (i & 7)];
                    texels[to + 2 * i] = order < 0 ? 0x8000 - order : order;
                    texels[to + 2 * i + 1] = o === 0 ? 0 : o === WHOLE ? HALF_OF_ONE : half(o / WHOLE);
                }
            }
        }
    }

    /** Writes the labels of the same texels, and which of their cells have no other. */
    label(texels: Uint8Array, corner: number, dims: Vec3): void {
        const { around, field: { labels, label }, there } = this, own = this.labels;
        for (let i = 0; i < own.length; i++) {
            const x = i % 9, y = Math.floor(i / 9) % 9, z = Math.floor(i / 81), at = around.at(x, y, z);
            own[i] = at < 0 ? label : labels![at];
            this.labelled[i] = (there[(z + 1) * AROUND + y + 1] >> (x + 1)) & 1;
        }
        labelled(own, this.labelled, this.alone);
        for (let i = 0; i < own.length; i++) {
            const y = Math.floor(i / 9) % 9, z = Math.floor(i / 81);
            const texel = 2 * (corner + (z * dims[1] + y) * dims[0] + i % 9);
            texels[texel] = own[i];
            texels[texel + 1] = this.alone[i];
        }
    }

    private readonly alone = new Uint8Array(APRONED ** 3);
}

/** Makes the atlas of a field, and fills in V beside what is known of it. */
export function makeAtlas(whole: Field, progress: Progress): Atlas {
    const boxes = occupied(whole.there), field = cropped(whole, boxes);
    const { bricks, slots, size, labels, label, known } = field;
    if (Math.max(...bricks) > 1 << PLACE_BITS) throw tooLarge(`a box of ${size.join(' × ')} voxels`);
    const kept = bricksNear(field, boxes, BEFORE, BEHIND), around = new Around(field);
    const placeOf = (number: number, [nx, ny]: Vec3): Vec3 =>
        [number % nx, Math.floor(number / nx) % ny, Math.floor(number / (nx * ny))];
    for (const work of known ? [fillIn, hold] : []) {
        for (const number of kept) {
            const [x, y, z] = placeOf(number, bricks);
            if (slots[number] < 0) continue;
            around.move(x, y, z);
            work(field, known!, around, slots[number], [x * 8 - 1, y * 8 - 1, z * 8 - 1]);
        }
    }
    const { middle, scale } = fitting(field), copier = new Copier(field, around, middle, scale);
    const value = (order: number): number => middle + scale * ofOrder(order);
    const small = new Intervals(size, spacingOf(field.worldFromVoxel));
    const across = atlasBricks(kept.length + 1), dims = across.map((n) => n * APRONED) as Vec3;
    const room = across[0] * across[1] * across[2], count = room * APRONED ** 3;
    const places = new Uint32Array(slots.length), brickAt = new Uint32Array(room).fill(NOWHERE);
    const texels = new Uint16Array(count * 2), labelTexels = labels ? new Uint8Array(count * 2) : null;
    // The first brick is empty: its V is that of the background, its O 0.
    [0, ...kept].forEach((number, to) => {
        if (to % 256 === 0) progress('arranging', to / kept.length);
        const [x, y, z] = placeOf(number, bricks), [px, py, pz] = placeOf(to, across);
        const corner = (pz * APRONED * dims[1] + py * APRONED) * dims[0] + px * APRONED;
        if (to === 0) {
            around.slots.fill(-1);
        } else {
            places[number] = packed(px, py, pz);
            brickAt[to] = packed(x, y, z);
            around.move(x, y, z);
        }
        if (copier.copy()) small.take([x, y, z], copier.orders, copier.there, value);
        copier.write(texels, corner, dims);
        if (labelTexels) copier.label(labelTexels, corner, dims);
    });
    return {
        size, worldFromVoxel: field.worldFromVoxel, edge: field.edge, range: field.range, middle, scale,
        bricks, places, brickAt, dims, texels, labels: labelTexels, label,
        leaps: { shift: small.shift, bricks: small.bricks, intervals: small.intervals },
        histograms: histogramsOf(field, boxes),
        splats: field.splats,
        times: {},
    };
}

/** As `cells`, and quickly where all that is there has one label. */
function labelled(labels: Uint8Array, there: Uint8Array, alone: Uint8Array): void {
    const first = there.indexOf(1);
    if (labels.every((label, i) => !there[i] || label === labels[first])) {
        if (first >= 0) labels.fill(labels[first]);
        else labels.fill(labels[0]);
        alone.fill(ALONE);
    } else {
        cells(labels, there, alone);
    }
}
