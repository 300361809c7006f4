// How the field that a page decodes differs from that of `vgs rasterize`.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { decodeSplats } from '../field/decode.ts';
import { readVgs } from '../field/vgs.ts';
import { voxel } from './field.ts';
import { nifti } from './nifti.ts';
import { vgs } from './program.ts';

/**
 * Root of the mean square and the worst difference of V in the mask, and the voxels whose O differs; null for splats of
 * another grid, with slices between those of the volume. Files are written to `scratch`.
 */
export function differences(
    splats: string, volume: string, scratch: string,
): { rms: number; worst: number; wrong: number } | null {
    const [values, mask] = ['field', 'occupancy'].map((quantity) => {
        const file = join(scratch, `${quantity}.nii.gz`);
        vgs('rasterize', splats, '--like', volume, '--quantity', quantity, '-o', file, '-f', '-q');
        return nifti(file);
    });
    const set = readVgs(new Uint8Array(readFileSync(splats)));
    const field = decodeSplats([{ set, numbers: [] }], () => {});
    const [nx, ny, nz] = set.grid!.size, [low] = field.faces;
    if (nx * ny * nz !== mask.length) return null;
    let sum = 0, count = 0, worst = 0, wrong = 0;
    for (let z = 0, i = 0; z < nz; z++) for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++, i++) {
        const { v, o } = voxel(field, x + low[0], y + low[1], z + low[2]);
        if ((o > 0.5) !== (mask[i] > 0.5)) wrong++;
        if (mask[i] <= 0.5) continue;
        const difference = Math.abs(v - values[i]);
        sum += difference ** 2;
        count++;
        worst = Math.max(worst, difference);
    }
    return { rms: Math.sqrt(sum / count), worst, wrong };
}
