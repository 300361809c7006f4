// Edges without stairs: the occupancy with which a region is shown (engine/volume/src/edges.rs, which has the
// method; here each voxel keeps its side of one half). In integers, as there.
import type { Vec3 } from '../types.ts';
import { Around, bricksNear, occupied } from './bricks.ts';
import { ROWS, SAMPLES } from './field.ts';

/** Voxels beyond the region at which depths end. */
export const MARGIN = 3;
/** Voxels of a region along x at a time: the box is as wide as some of these, and nothing lies beyond. */
export const RUN = 16;
/** Voxels beyond the region whose depths count. */
export const REACH = 4;
/** Parts of a voxel that depths are counted in, and voxels at which they are clipped: 0 is so far outside. */
const UNIT = 512, CLIP = 2;
/** Distance outside the surface at which O is 0, and depth at which it is 1. */
const RAMPS = [1, 0.5];
/** Least depth of a voxel, voxels. */
const KEPT = 0.02;
const ROUNDS = 4, WIDEST = 2;
/** Squared distance, voxels, from which on the depth of a voxel is clipped. */
const FAR = 9;
/**
 * Of codes, the part that says that a voxel is inside; the rest is the squared distance to the nearest voxel
 * of the other side, 0 if it is far.
 */
const INSIDE = 16;
/** Voxels along each axis of a brick and those around it. */
const WIDE = 8 + 2 * WIDEST;
/** Two depths are kept in a word, for speed, with this added to each so that none is below 0. */
const BIAS = 2 * CLIP * UNIT, NOTHING = BIAS | (BIAS << 16);
/** Words in a row of voxels, in such a row with one more on either side, and in a brick. */
const ROW = 4, WIDE_ROW = ROW + 2, WORDS = ROW * ROWS;

/** The least depth of each code, the greatest, and the one to begin with. */
const LIMITS = [0, 1, 2].map((which) => Int16Array.from({ length: 2 * INSIDE }, (_, code) => {
    const distance = Math.sqrt(code % INSIDE || 4 * FAR), least = Math.max(distance - 1, KEPT);
    const side = [least, distance, distance - 0.5];
    const depth = code >= INSIDE ? side[which] : [-distance, -least, 0.5 - distance][which];
    return BIAS + Math.round((Math.min(Math.max(depth, -CLIP), CLIP) + CLIP) * UNIT);
}));

interface Bricks {
    bricks: Vec3;
    slots: Int32Array;
}

/**
 * Returns O of the voxels of each slot, 255 being 1. `inside` has the region as a byte for each row of voxels
 * of a slot; there is a slot wherever a voxel of the region is within `REACH`, and `last` is the last place
 * along each axis: the faces of the box are at `MARGIN` voxels from the region.
 */
export function occupancy(of: Bricks, inside: Uint8Array, last: Vec3): Uint8Array {
    const count = inside.length / ROWS, { bricks, slots } = of, around = new Around(of);
    const codes = new Uint8Array(count * SAMPLES), near = new Uint8Array(count * ROWS);
    const [least, most, begin] = LIMITS;
    slots.forEach((slot, number) => {
        if (slot >= 0) around.move(...placeOf(number, bricks));
        if (slot >= 0) mark(around, inside, slot, codes, near);
    });
    const depths = new Int32Array(count * WORDS), sharpened = new Int32Array(count * WORDS);
    for (let i = 0; i < depths.length; i++) depths[i] = begin[codes[2 * i]] | (begin[codes[2 * i + 1]] << 16);
    const boxes = occupied(near);
    const wide = bricksNear(of, boxes, WIDEST, WIDEST), narrow = bricksNear(of, boxes, 0, 0);
    const filter = new Filter(around, bricks, last);
    for (let round = 0; round < ROUNDS; round++) {
        for (let stride = WIDEST; stride > 0; stride--) {
            for (const number of wide) {
                filter.alongYZ(depths, number, stride);
                for (let row = 0, to = slots[number] * WORDS; row < ROWS; row++) {
                    for (let i = 0; i < ROW; i++, to++) {
                        sharpened[to] = 2 * depths[to] - filter.at(row, i, stride);
                    }
                }
            }
            for (const number of narrow) {
                filter.alongYZ(sharpened, number, stride);
                for (let row = 0; row < ROWS; row++) {
                    if (near[slots[number] * ROWS + row] === 0) continue;
                    for (let i = 0, to = (slots[number] * ROWS + row) * ROW; i < ROW; i++, to++) {
                        const two = filter.at(row, i, stride);
                        const code = codes[2 * to], other = codes[2 * to + 1];
                        depths[to] = Math.min(Math.max(two & 0xffff, least[code]), most[code]) |
                            (Math.min(Math.max(two >>> 16, least[other]), most[other]) << 16);
                    }
                }
            }
        }
    }
    for (let i = 0; i < codes.length; i++) {
        const depth = ((depths[i >> 1] >> (i & 1 ? 16 : 0)) & 0xffff) - BIAS;
        const inside = (depth - CLIP * UNIT) / UNIT;
        const level = 127.5 * inside / (inside > 0 ? RAMPS[1] : RAMPS[0]);
        codes[i] = Math.min(Math.max(Math.round(127.5 + level), 0), 255);
    }
    return codes;
}

/** Coordinates of a brick. */
function placeOf(number: number, [nx, ny]: Vec3): Vec3 {
    return [number % nx, Math.floor(number / nx) % ny, Math.floor(number / (nx * ny))];
}

const rows = new Uint16Array(WIDE ** 2), others = [new Uint8Array(FAR), new Uint8Array(FAR)];

/** Writes the codes of the voxels of a brick, and which of them are near the surface. */
function mark(around: Around, inside: Uint8Array, slot: number, codes: Uint8Array, near: Uint8Array): void {
    let any = 0, all = 0xfff;
    for (let i = 0; i < rows.length; i++) {
        rows[i] = around.row(inside, i % WIDE - WIDEST, Math.floor(i / WIDE) - WIDEST, WIDEST);
        any |= rows[i];
        all &= rows[i];
    }
    if (any === 0 || all === 0xfff) {
        codes.fill(any ? INSIDE : 0, slot * SAMPLES, (slot + 1) * SAMPLES);
        return;
    }
    const [empty, full] = others;
    for (let j = 0; j < ROWS; j++) {
        const middle = ((j >> 3) + WIDEST) * WIDE + (j & 7) + WIDEST, own = rows[middle] >> WIDEST;
        // By squared distance: beside which voxels there is one that is not inside, and one that is.
        empty.fill(0);
        full.fill(0);
        for (let dz = -WIDEST; dz <= WIDEST; dz++) {
            for (let dy = -WIDEST; dy <= WIDEST; dy++) {
                const row = rows[middle + dz * WIDE + dy];
                for (let dx = 0; dx <= WIDEST; dx++) {
                    const squared = dx * dx + dy * dy + dz * dz;
                    if (squared >= FAR) continue;
                    full[squared] |= (row >> (WIDEST + dx)) | (row >> (WIDEST - dx));
                    empty[squared] |= (~row >> (WIDEST + dx)) | (~row >> (WIDEST - dx));
                }
            }
        }
        for (let i = 0; i < 8; i++) {
            const side = (own >> i) & 1, other = side ? empty : full;
            let squared = 1;
            while (squared < FAR && !((other[squared] >> i) & 1)) squared++;
            codes[slot * SAMPLES + j * 8 + i] = side * INSIDE + squared % FAR;
            if (squared < FAR) near[slot * ROWS + j] |= 1 << i;
        }
    }
}

/** The binomial filter ¼ ½ ¼ along each axis, of voxels that are `stride` apart. */
class Filter {
    private readonly around: Around;
    private readonly bricks: Vec3;
    private readonly last: Vec3;
    private readonly whole = new Int32Array(WIDE * WIDE * WIDE_ROW);
    private readonly alongY = new Int32Array(WIDE * 8 * WIDE_ROW);
    private readonly alongZ = new Int32Array(ROWS * WIDE_ROW);

    constructor(around: Around, bricks: Vec3, last: Vec3) {
        this.around = around;
        this.bricks = bricks;
        this.last = last;
    }

    /** Filters a brick along y, then along z. */
    alongYZ(from: Int32Array, number: number, stride: number): void {
        this.read(from, number, stride);
        const { whole, alongY, alongZ } = this, slice = 8 * WIDE_ROW;
        for (let k = WIDEST - stride; k < WIDE - WIDEST + stride; k++) {
            const middle = (k * WIDE + WIDEST) * WIDE_ROW, step = stride * WIDE_ROW;
            for (let at = middle, to = k * slice; at < middle + slice; at++, to++) {
                alongY[to] = means(whole[at - step], whole[at], whole[at + step]);
            }
        }
        for (let to = 0, at = WIDEST * slice, step = stride * slice; to < alongZ.length; at++, to++) {
            alongZ[to] = means(alongY[at - step], alongY[at], alongY[at + step]);
        }
    }

    /** Word `i` of a row of the brick, filtered along x too. */
    at(row: number, i: number, stride: number): number {
        const { alongZ } = this, at = row * WIDE_ROW + 1 + i;
        const left = alongZ[at - 1], own = alongZ[at], right = alongZ[at + 1];
        return stride === 2 ? means(left, own, right)
            : means((own << 16) | (left >>> 16), own, (own >>> 16) | (right << 16));
    }

    /** Reads a brick and what is around: beyond the faces along y and z what is at them, along x nothing. */
    private read(from: Int32Array, number: number, margin: number): void {
        const { whole, around, last } = this, { slots } = around, [x, y, z] = placeOf(number, this.bricks);
        around.move(x, y, z);
        for (let k = -margin; k < 8 + margin; k++) {
            const pz = Math.min(Math.max(z * 8 + k, 0), last[2]) - z * 8;
            for (let j = -margin; j < 8 + margin; j++) {
                const py = Math.min(Math.max(y * 8 + j, 0), last[1]) - y * 8;
                const line = ((pz + 8) >> 3) * 9 + ((py + 8) >> 3) * 3, row = ((pz & 7) * 8 + (py & 7)) * ROW;
                const left = slots[line], own = slots[line + 1], right = slots[line + 2];
                const to = ((k + WIDEST) * WIDE + j + WIDEST) * WIDE_ROW;
                whole[to] = left < 0 ? NOTHING : from[left * WORDS + row + ROW - 1];
                for (let i = 0; i < ROW; i++) {
                    whole[to + 1 + i] = own < 0 ? NOTHING : from[own * WORDS + row + i];
                }
                whole[to + 1 + ROW] = right < 0 ? NOTHING : from[right * WORDS + row];
            }
        }
    }
}

/** Means of the two numbers in each of three words, with weights ¼ ½ ¼. */
function means(a: number, b: number, c: number): number {
    return ((a + 2 * b + c + 0x20002) >>> 2) & 0x3fff3fff;
}
