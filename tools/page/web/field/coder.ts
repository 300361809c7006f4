// The reader of the adaptive binary range coder of .vgs files (engine/splat/src/vgs/coder.rs), and the gaps
// between places along a Morton curve that it has (engine/splat/src/vgs/morton.rs).

const TOP = 1 << 24;
/** A bit's probability moves by one part in at least this many, once that many have been seen. */
const MEMORY = 250;

/** The number of bits of a number below 2^32. */
export const bitsOf = (n: number): number => 32 - Math.clz32(n);

/** Models of the bits of the numbers 0 to `last`, at most 65535: one for each prefix. */
export class Tree {
    readonly bits: number;
    /** Probability of a 0 in 1/65536. */
    readonly zero: Uint16Array;
    /** Number of bits seen. */
    readonly seen: Uint8Array;

    constructor(last: number) {
        this.bits = bitsOf(last);
        this.zero = new Uint16Array(1 << this.bits).fill(1 << 15);
        this.seen = new Uint8Array(1 << this.bits);
    }
}

/** Reads numbers. Bytes that no coder wrote give other numbers, each within its range. */
export class Decoder {
    private readonly bytes: Uint8Array;
    private at = 0;
    private code = 0;
    private range = 0xffffffff;
    /** True if more was read than was written. */
    isBeyond = false;

    constructor(bytes: Uint8Array) {
        this.bytes = bytes;
        for (let i = 0; i < 4; i++) this.code = ((this.code << 8) | this.byte()) >>> 0;
    }

    /** Reads a bit whose model is at `node` of `tree`. */
    bit(tree: Tree, node: number): number {
        const p = Math.min(Math.max(tree.zero[node] >> 1, 32), 32768 - 32);
        return this.learned(tree, node, Math.imul(this.range >>> 15, p) >>> 0);
    }

    /** The same, where neither a 0 nor a 1 is less probable than `least` in 65536. */
    decision(tree: Tree, node: number, least: number): number {
        const p = Math.min(Math.max(tree.zero[node], least), 65536 - least);
        return this.learned(tree, node, Math.imul(this.range >>> 16, p) >>> 0);
    }

    /** Reads a bit of which nothing is known, as those of decisions. */
    coin(): number {
        return this.divided((this.range >>> 16) * 32768);
    }

    /** Reads a bit, `bound` being the part of the range that a 0 has, and learns it. */
    private learned({ zero, seen }: Tree, node: number, bound: number): number {
        const p = zero[node], n = seen[node], bit = this.divided(bound);
        seen[node] = n < MEMORY ? n + 1 : n;
        zero[node] = bit ? p - ((2 * p / (2 * n + 3)) | 0) : p + ((2 * (65535 - p) / (2 * n + 3)) | 0);
        return bit;
    }

    private divided(bound: number): number {
        const bit = this.code >= bound ? 1 : 0;
        if (bit) {
            this.code = (this.code - bound) >>> 0;
            this.range = (this.range - bound) >>> 0;
        } else {
            this.range = bound;
        }
        while (this.range < TOP) {
            this.range = (this.range << 8) >>> 0;
            this.code = ((this.code << 8) | this.byte()) >>> 0;
        }
        return bit;
    }

    /** Reads a number of the range of `tree`. */
    number(tree: Tree): number {
        let node = 1;
        for (let i = 0; i < tree.bits; i++) node = node * 2 + this.bit(tree, node);
        return node - (1 << tree.bits);
    }

    /** Reads one of `count` equally likely numbers, `count` at most 65536. */
    even(count: number): number {
        if (count <= 1) return 0;
        let range = (this.range / count) >>> 0;
        const number = Math.min((this.code / range) >>> 0, count - 1);
        let code = this.code - number * range;
        while (range < TOP) {
            range = (range << 8) >>> 0;
            code = ((code << 8) | this.byte()) >>> 0;
        }
        this.code = code;
        this.range = range;
        return number;
    }

    private byte(): number {
        if (this.at < this.bytes.length) return this.bytes[this.at++];
        this.isBeyond = true;
        return 0;
    }
}

/** Bits of a gap below its highest that have models. */
const GAP_BITS = 2;
/** Codes have 63 bits: three for each of the 21 of an index along an axis. They are kept as two numbers. */
const LOW = 2 ** 30;
const HIGH = 2 ** 33;

/** Places along a Morton curve, read as gaps between ascending codes. The first gap counts from code 0. */
export class Places {
    private readonly bits = new Tree(63);
    private readonly next: Tree[] = [];
    private high = 0;
    private low = 0;

    constructor() {
        for (let i = 0; i < 64; i++) this.next.push(new Tree((1 << GAP_BITS) - 1));
    }

    /** Goes back to code 0; what was learned stays. */
    restart(): void {
        this.high = this.low = 0;
    }

    /**
     * Reads the next code: 0 if it is the last one again, 1 if it is a later one, -1 if there is no such
     * place.
     */
    read(input: Decoder): number {
        const bits = input.number(this.bits);
        let high = 0, low = bits > 0 ? 1 : 0, rest = Math.max(bits - 1, 0), modelled = rest > GAP_BITS;
        while (rest > 0) {
            const count = modelled ? GAP_BITS : Math.min(rest, 16);
            low = low * (1 << count) + (modelled ? input.number(this.next[bits]) : input.even(1 << count));
            const carry = Math.floor(low / LOW);
            low -= carry * LOW;
            high = high * (1 << count) + carry;
            rest -= count;
            modelled = false;
        }
        low += this.low;
        const carry = low >= LOW ? 1 : 0;
        this.low = low - carry * LOW;
        this.high += high + carry;
        if (this.high >= HIGH) return -1;
        return bits > 0 ? 1 : 0;
    }

    /** The index of the place along an axis: 0 is x, 1 is y, 2 is z. */
    index(axis: number): number {
        const shift = 2 - axis, top = Math.floor(this.high / LOW), middle = this.high - top * LOW;
        return every3rd(this.low >> shift) + every3rd(middle >> shift) * 1024 +
            ((top >> shift) & 1) * 1048576;
    }
}

/** Gathers every third of 30 bits. */
function every3rd(bits: number): number {
    bits &= 0x09249249;
    bits = (bits | (bits >> 2)) & 0x030c30c3;
    bits = (bits | (bits >> 4)) & 0x0300f00f;
    bits = (bits | (bits >> 8)) & 0x030000ff;
    return (bits | (bits >> 16)) & 0x3ff;
}
