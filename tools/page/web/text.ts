// Bytes as text that HTML leaves as it is: 13 bits in two of the printable characters of ASCII but for the quotation mark,
// the ampersand and the less-than sign, the lower part first.

const LETTERS = 91;

/** The bytes that a text stands for; `count` of them. */
export function bytesOf(text: string, count: number): Uint8Array<ArrayBuffer> {
    const values = new Uint8Array(128);
    for (let code = 33, value = 0; code < 127; code++)
        if (code !== 34 && code !== 38 && code !== 60) values[code] = value++;
    const bytes = new Uint8Array(count);
    let held = 0, bits = 0, at = 0;
    for (let i = 0; at < count; i += 2) {
        held |= (values[text.charCodeAt(i) & 127] + LETTERS * values[text.charCodeAt(i + 1) & 127]) << bits;
        for (bits += 13; bits >= 8 && at < count; bits -= 8, held >>>= 8) bytes[at++] = held;
    }
    return bytes;
}
