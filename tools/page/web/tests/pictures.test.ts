// Pictures of pages beside those of `vgs render`: every preset, lit and unlit, objects, planes, occlusion and gradient
// opacity, each through a page that `vgs convert` has written. VGS_PROGRAM names the program, VGS_RUNNER what starts it.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { after, before, test } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { PNG } from 'pngjs';
import type { Look, Material, Pick, Scene } from '../types.ts';
import { viewOf } from '../ui/camera.ts';
import { harness, launch, missing, open } from './browser.ts';
import { differences } from './differences.ts';
import { contentOf, likeness, program, vgs } from './program.ts';

const skip = missing || (program ? false : 'VGS_PROGRAM names no program');
const fixtures = new URL('./fixtures/', import.meta.url).pathname;
/** Width and height of the pictures, pixels. */
const SIZE = 144;
/** Least likeness, dB, over the whole picture. */
const LIKE = 60;

let browser: Browser, scratch: string;
before(async () => {
    scratch = mkdtempSync(join(tmpdir(), 'vgs-pictures-'));
    if (!skip) browser = await launch();
});
after(async () => {
    await browser?.close();
    rmSync(scratch, { recursive: true });
});

/** The scene and the data of a page that `vgs convert` writes. */
function written(name: string, flags: string[]): { scene: Scene; parts: object[] } {
    const file = join(scratch, 'page.html');
    vgs('convert', ...name.split(' ').map((part) => resolve(fixtures, part)), '-o', file, '--force', '-q', ...flags);
    return contentOf(file);
}

/** The picture of `vgs render`, RGBA, rows from the top. */
function rendered(name: string, flags: string[]): Buffer {
    const file = join(scratch, 'picture.png');
    const files = name.split(' ').map((part) => resolve(fixtures, part));
    const quality = ['--mode', 'decoded', '--size', `${SIZE}x${SIZE}`, '--step', '0.25'];
    vgs('render', ...files, '-o', file, '--force', '-q', ...quality, ...flags);
    return PNG.sync.read(readFileSync(file)).data;
}

/** How many pixels are not as dark as the background. */
const shown = (picture: Buffer) => picture.filter((v, i) => i % 4 === 1 && v > 8).length;

async function drawn(page: Page, scene: Scene): Promise<Buffer> {
    const { light, clip, background, camera } = scene;
    const objects = scene.objects.map(({ number, ...object }) => [number, object]);
    const look = { function: scene.function, light, clip, background } as unknown as Look;
    const { text } = await page.evaluate(([view, look, objects, size]) =>
        // @ts-expect-error: drawing.ts puts it there.
        api.picture(view, look, objects, { step: 0.25, cell: null, occlusion: true }, size, size) as { text: string },
    [viewOf(camera, 1), look, objects, SIZE] as const);
    return Buffer.from(text, 'base64');
}

/** A picture: flags of `vgs convert` and `vgs render`, flags of the latter alone, and what they mean for the page. */
interface Case {
    both?: string[];
    render?: string[];
    page?: (scene: Scene) => Scene;
}

const material = (change: Partial<Material>) => (scene: Scene): Scene =>
    ({ ...scene, function: { ...scene.function, material: { ...scene.function.material, ...change } } });

/** Compares pages with `vgs render`. */
async function compare(name: string, cases: Case[]): Promise<void> {
    const { page, close } = await open(browser, await harness('drawing.ts'));
    const poor: string[] = [];
    for (const { both = [], render = [], page: change = (scene: Scene) => scene } of cases) {
        const flags = ['--camera', 'anterior-left-superior', ...both];
        const { scene, parts } = written(name, flags);
        // @ts-expect-error: drawing.ts puts it there.
        await page.evaluate((parts) => api.load(parts), parts);
        const theirs = rendered(name, [...flags, ...render]);
        const what = [...both, ...render].join(' ');
        assert.ok(shown(theirs) > 50, `${what} shows nothing`);
        const like = likeness(await drawn(page, change(scene)), theirs);
        if (!(like >= LIKE)) poor.push(`${what}: ${like.toFixed(1)} dB`);
    }
    await close();
    assert.deepEqual(poor, [], `pictures of ${name} less like than ${LIKE} dB`);
}

test('every preset that shows something, lit and unlit', { skip }, async () => {
    const presets = [
        'CT-Bone', 'CT-Bones-Steep', 'CT-Soft-Tissue', 'CT-Angio', 'CT-Muscle', 'CT-Liver-Vasculature', 'CT-X-Ray',
        'Grey',
    ];
    await compare('binary.vgs', presets.flatMap((tf) => [true, false].map((shade) => ({
        both: ['--tf', tf], render: ['--shade', shade ? 'on' : 'off'], page: material({ shade }),
    }))));
});

test('objects with colours, opacities and functions, and a hidden one', { skip }, async () => {
    await compare('labels.vgs', [
        {},
        { both: ['--tf', 'CT-Soft-Tissue', '--object-colours'] },
        { both: ['--tf', 'CT-Bone', '--object', '3:colour=#30a0e0,opacity=0.3'] },
        { both: ['--tf', 'CT-Bone', '--object', '7:hidden'] },
        { both: ['--tf', 'CT-Bone', '--object', '3:tf=CT-Soft-Tissue'] },
    ]);
});

test('what is read under a picture is there, also behind translucent layers', { skip }, async () => {
    const { page, close } = await open(browser, await harness('drawing.ts'));
    const { scene, parts } = written('binary.vgs', ['--camera', 'anterior', '--tf', 'CT-X-Ray']);
    // @ts-expect-error: drawing.ts puts it there.
    await page.evaluate((parts) => api.load(parts), parts);
    await drawn(page, scene);
    const place = (i: number) => (i + 0.5) * SIZE / 20;
    const places = Array.from({ length: 400 }, (_, i) => [place(i % 20), place(Math.floor(i / 20))]);
    const read = await page.evaluate(([view, size, places]) =>
        // @ts-expect-error: drawing.ts puts it there.
        api.read(view, size, places) as (Pick | null)[][], [viewOf(scene.camera, 1), SIZE, places] as const);
    await close();
    const met = read.filter(([first]) => first);
    assert.ok(met.length > 20 && met.length < 400, `${met.length} of 400 places`);
    for (const [first, there] of met) {
        assert.ok(there, `nothing at ${first!.place}`);
        assert.ok(Math.abs(first!.value - there.value) < 2, `${first!.value} and ${there.value}`);
    }
});

test('soft masks, and a field on voxels', { skip }, async () => {
    await compare('soft.vgs', [{ both: ['--tf', 'CT-Soft-Tissue'] }, { both: ['--tf', 'CT-Bone'] }]);
    // Splats that take more bytes than their voxels.
    await compare('binary.vgs binary.vgs', [{ both: ['--tf', 'CT-Bone'] }]);
});

test('fits to regions that overlap', { skip }, async () => {
    const [ct, whole, other] = ['ct', 'whole', 'other'].map((name) => join(scratch, `${name}.nii.gz`));
    vgs('phantom', '-o', join(scratch, 'none.nii.gz'), '--mask', other, '--size', '40', '--seed', '1', '-q', '-f');
    vgs('phantom', '-o', ct, '--mask', whole, '--size', '40', '-q', '-f');
    const files = [whole, other].map((mask) => {
        const file = mask.replace('.nii.gz', '.vgs');
        vgs('fit', ct, '--roi', mask, '--splats', '150', '-o', file, '-q', '-f');
        const { worst, wrong } = differences(file, ct, scratch)!;
        assert.ok(worst < 0.05 && wrong === 0, `V differs by up to ${worst}, and O at ${wrong} voxels`);
        return file;
    });
    const { scene } = written(files.join(' '), []);
    assert.deepEqual(scene.parts.map(({ kind }) => kind), ['vgs', 'vgs']);
    await compare(files.join(' '), [
        { both: ['--tf', 'CT-Bone'] }, { both: ['--tf', 'CT-Soft-Tissue', '--object-colours'] },
        { both: ['--tf', 'CT-Bone', '--object', '2:hidden'] },
    ]);
});

test('coded voxels, alone and beside splats', { skip }, async () => {
    const [ct, whole, other] = ['ct', 'whole', 'other'].map((name) => join(scratch, `${name}.nii.gz`));
    const [coded, fitted] = ['coded', 'fitted'].map((name) => join(scratch, `${name}.vgs`));
    vgs('phantom', '-o', join(scratch, 'none.nii.gz'), '--mask', other, '--size', '40', '--seed', '1', '-q', '-f');
    vgs('phantom', '-o', ct, '--mask', whole, '--size', '40', '-q', '-f');
    vgs('convert', ct, '--roi', whole, '-o', coded, '--bound', '5', '-q', '-f');
    vgs('fit', ct, '--roi', other, '--splats', '150', '-o', fitted, '-q', '-f');
    const cases = [{ both: ['--tf', 'CT-Bone'] }, { both: ['--tf', 'CT-Soft-Tissue', '--object-colours'] }];
    for (const files of [coded, `${coded} ${fitted}`, `${fitted} ${coded}`]) {
        assert.ok(written(files, []).scene.parts.every(({ kind }) => kind === 'vgs'));
        await compare(files, cases);
    }
});

test('planes, occlusion, gradient opacity and light', { skip }, async () => {
    const bone = ['--tf', 'CT-Bone'];
    await compare('binary.vgs', [
        { both: [...bone, '--clip', 'x<0', '--clip', 'z>-4'] },
        { both: bone, render: ['--occlusion', '0.8'], page: material({ occlusion: 0.8 }) },
        {
            both: bone, render: ['--gradient-opacity', '30,120'],
            page: (scene) => ({ ...scene, function: { ...scene.function, gradientOpacities: [[30, 0], [120, 1]] } }),
        },
        {
            both: bone, render: ['--light-direction', 'left', '--fill-light', '0.3'],
            page: (scene) => ({ ...scene, light: { direction: [-1, 0, 0], fixedTo: 'patient', fill: 0.3 } }),
        },
    ]);
});
