// Bricks of a field, and what lies beside one of them.
import type { Vec3 } from '../types.ts';
import { ROWS, SAMPLES } from './field.ts';
import type { Field } from './field.ts';

type Bricks = Pick<Field, 'bricks' | 'slots'>;

/** Calls `each` with the coordinates and the number of every brick, x fastest. */
export function eachBrick(
    [nx, ny, nz]: Vec3, each: (x: number, y: number, z: number, number: number) => void,
): void {
    for (let z = 0, number = 0; z < nz; z++) {
        for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) each(x, y, z, number++);
    }
}

/** Least and greatest place with something in it, along x, y, z, of each slot; 8 and -1: none. */
export function occupied(there: Uint8Array): Int8Array {
    const boxes = new Int8Array(there.length / ROWS * 6), bits = [0, 0, 0];
    for (let row = 0, box = 0; row < there.length; box += 6) {
        bits.fill(0);
        for (let j = 0; j < ROWS; j++, row++) {
            if (there[row] === 0) continue;
            bits[0] |= there[row];
            bits[1] |= 1 << (j & 7);
            bits[2] |= 1 << (j >> 3);
        }
        for (let k = 0; k < 3; k++) {
            boxes[box + k] = bits[k] ? 31 - Math.clz32(bits[k] & -bits[k]) : 8;
            boxes[box + 3 + k] = 31 - Math.clz32(bits[k]);
        }
    }
    return boxes;
}

/**
 * Numbers of the bricks in which something is, or at most so many voxels before or behind them; ascending.
 */
export function bricksNear(
    { bricks, slots }: Bricks, boxes: Int8Array, before: number, behind: number,
): number[] {
    const kept = new Uint8Array(slots.length);
    /** From which other bricks along an axis a box is seen. */
    const reach = (box: number, k: number, brick: number): [number, number] => [
        brick > 0 && boxes[box + k] < behind ? -1 : 0,
        brick + 1 < bricks[k] && boxes[box + 3 + k] >= 8 - before ? 1 : 0,
    ];
    eachBrick(bricks, (x, y, z, number) => {
        const box = slots[number] * 6;
        if (box < 0 || boxes[box] > 7) return;
        const [x0, x1] = reach(box, 0, x), [y0, y1] = reach(box, 1, y), [z0, z1] = reach(box, 2, z);
        for (let dz = z0; dz <= z1; dz++) {
            for (let dy = y0; dy <= y1; dy++) {
                for (let dx = x0; dx <= x1; dx++) kept[number + (dz * bricks[1] + dy) * bricks[0] + dx] = 1;
            }
        }
    });
    return Array.from(kept.keys()).filter((number) => kept[number]);
}

/** A brick and those around it. */
export class Around {
    /** Slots of the 27 bricks, x fastest; -1: none. */
    readonly slots = new Int32Array(27);
    private readonly of: Bricks;
    private readonly rows = new Uint16Array(100);

    constructor(of: Bricks) {
        this.of = of;
    }

    /** Goes to a brick. */
    move(x: number, y: number, z: number): void {
        const { bricks: [nx, ny, nz], slots } = this.of;
        for (let dz = -1, n = 0; dz <= 1; dz++) {
            for (let dy = -1; dy <= 1; dy++) {
                const Y = y + dy, Z = z + dz, row = (Z * ny + Y) * nx;
                const inRow = Y >= 0 && Y < ny && Z >= 0 && Z < nz;
                for (let X = x - 1; X <= x + 1; X++) {
                    this.slots[n++] = inRow && X >= 0 && X < nx ? slots[row + X] : -1;
                }
            }
        }
    }

    /**
     * Bits of a row along x from `before` voxels before the brick to as many behind it. `y` and `z` count
     * from the brick's first voxel, -8 to 15.
     */
    row(bits: Uint8Array, y: number, z: number, before: number): number {
        const { slots } = this, first = ((z + 8) >> 3) * 9 + ((y + 8) >> 3) * 3, row = (z & 7) * 8 + (y & 7);
        const left = slots[first], own = slots[first + 1], right = slots[first + 2];
        return (left < 0 ? 0 : bits[left * ROWS + row] >> (8 - before)) |
            (own < 0 ? 0 : bits[own * ROWS + row] << before) |
            (right < 0 ? 0 : (bits[right * ROWS + row] & ((1 << before) - 1)) << (8 + before));
    }

    /**
     * Writes bits of the rows of the brick: which voxels are set or beside one that is, corners included.
     * Returns false if none is.
     */
    near(bits: Uint8Array, to: Uint8Array): boolean {
        const { rows } = this;
        let any = 0;
        for (let i = 0; i < 100; i++) {
            any |= rows[i] = this.row(bits, i % 10 - 1, Math.floor(i / 10) - 1, 1);
        }
        for (let j = 0; j < ROWS; j++) {
            let near = 0;
            for (let i = (j >> 3) * 10 + (j & 7), k = 0; any && k < 3; i += 10, k++) {
                near |= rows[i] | rows[i + 1] | rows[i + 2];
            }
            to[j] = (near | (near << 1) | (near >> 1)) >> 1;
        }
        return any !== 0;
    }

    /** Where a voxel is in the arrays of the field; -1: nowhere. */
    at(x: number, y: number, z: number): number {
        const slot = this.slots[((z + 8) >> 3) * 9 + ((y + 8) >> 3) * 3 + ((x + 8) >> 3)];
        return slot < 0 ? -1 : slot * SAMPLES + (z & 7) * 64 + (y & 7) * 8 + (x & 7);
    }
}
