// Volumes in NIfTI files, as the program writes them.
import { readFileSync, writeFileSync } from 'node:fs';
import { gunzipSync, gzipSync } from 'node:zlib';

/** Where voxels begin, and the fields of their type and its bits in the header. */
const DATA = 108, TYPE = 70, BITS = 72;
const INT16 = 4, FLOAT32 = 16;

/** Voxels of a file of 32-bit floats, x fastest. */
export function nifti(file: string): Float32Array {
    const bytes = gunzipSync(readFileSync(file));
    if (bytes.readInt16LE(TYPE) !== FLOAT32) throw new Error(`${file} has other voxels`);
    const from = bytes.readFloatLE(DATA);
    return new Float32Array(bytes.buffer.slice(bytes.byteOffset + from, bytes.byteOffset + bytes.length));
}

/** Writes whole numbers on the grid of a file. */
export function writeWhole(like: string, values: ArrayLike<number>, to: string): void {
    const bytes = gunzipSync(readFileSync(like)), header = bytes.subarray(0, bytes.readFloatLE(DATA));
    header.writeInt16LE(INT16, TYPE);
    header.writeInt16LE(16, BITS);
    const voxels = new Uint8Array(Int16Array.from(values, Math.round).buffer);
    writeFileSync(to, gzipSync(Buffer.concat([header, voxels])));
}
