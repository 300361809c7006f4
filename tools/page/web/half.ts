// Floating-point numbers of 16 bits.

const asFloat = new Float32Array(1);
const asWord = new Uint32Array(asFloat.buffer);

/** The bits of the half that is nearest to a number, to even ones between two; the greatest where it is greater. */
export function half(value: number): number {
    asFloat[0] = value;
    const word = asWord[0], sign = (word >>> 16) & 0x8000, exponent = ((word >>> 23) & 255) - 112;
    if (exponent >= 31) return sign | 0x7bff;
    // Below 2^-14 halves lie 2^-24 apart; adding 2^-1 in f32 rounds to just that.
    if (exponent <= 0) {
        asFloat[0] = Math.abs(asFloat[0]) + 0.5;
        return sign | (asWord[0] - 0x3f000000);
    }
    const bits = (exponent << 10) | ((word >>> 13) & 0x3ff), rest = word & 0x1fff;
    const up = rest > 0x1000 || (rest === 0x1000 && (bits & 1) === 1) ? 1 : 0;
    return sign | Math.min(bits + up, 0x7bff);
}
