// Calls the program `vgs` that VGS_PROGRAM names, through the runner that VGS_RUNNER names, and reads what it writes.
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { bytesOf } from '../text.ts';
import type { Scene } from '../types.ts';

/** The program; undefined where none is named. */
export const program = process.env['VGS_PROGRAM'];

export function vgs(...flags: string[]): void {
    const words = [process.env['VGS_RUNNER'], program, ...flags].filter((word) => word !== undefined);
    execFileSync(words[0], words.slice(1), { stdio: ['ignore', 'ignore', 'inherit'] });
}

/** The scene of a page, and its parts with their data as drawing.ts takes them. */
export function contentOf(file: string): { scene: Scene; parts: object[] } {
    const html = readFileSync(file, 'utf8');
    const element = (id: string) => new RegExp(`id="${id}">([^<]*)<`).exec(html)![1];
    const scene: Scene = JSON.parse(element('scene'));
    const parts = scene.parts.map((part, i) => ({
        ...part, text: Buffer.from(bytesOf(element(`data-${i}`), part.bytes)).toString('base64'),
    }));
    return { scene, parts };
}

/** Likeness of two pictures, RGBA, dB over the whole of them. */
export function likeness(a: Buffer, b: Buffer): number {
    let sum = 0;
    for (let i = 0; i < a.length; i++) if (i % 4 < 3) sum += (a[i] - b[i]) ** 2;
    return 10 * Math.log10((255 ** 2 * a.length * 0.75) / Math.max(sum, 1));
}
