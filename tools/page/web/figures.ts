// Makes docs/results/data/page.csv: node figures.ts NAME=SPLATS,VOLUME… with files of splats fitted for the grid of a volume.
// For each: bytes; how V and the mask that the page decodes differ from `vgs rasterize`; likeness of its pictures to those of
// `vgs render`; and times in a browser with a software driver. VGS_PAGE, VGS_PROGRAM and VGS_RUNNER as for the tests.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { availableParallelism, tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { PNG } from 'pngjs';
import { readVgs } from './field/vgs.ts';
import { harness, launch, open } from './tests/browser.ts';
import { differences } from './tests/differences.ts';
import { contentOf, likeness, vgs } from './tests/program.ts';
import type { Look } from './types.ts';
import { viewOf } from './ui/camera.ts';

const FUNCTIONS = ['CT-Bone', 'CT-Bones-Steep', 'CT-Soft-Tissue'];
/** Width and height of the pictures that are compared, pixels. */
const SIZE = 512;
const QUALITY = { step: 0.25, cell: null, occlusion: true };
const scratch = mkdtempSync(join(tmpdir(), 'vgs-figures-'));

/** Likeness of the page's pictures to those of `vgs render`, dB over the whole picture, for each function, lit and unlit. */
async function likenesses(browser: Browser, splats: string): Promise<number[]> {
    const { page, close } = await open(browser, await harness('drawing.ts'));
    const found: number[] = [];
    const file = join(scratch, 'page.html'), picture = join(scratch, 'picture.png');
    const camera = ['--camera', 'anterior-left-superior'];
    for (const tf of FUNCTIONS) {
        vgs('convert', splats, '-o', file, '-f', '-q', '--tf', tf, ...camera);
        const { scene, parts } = contentOf(file);
        // @ts-expect-error: drawing.ts puts it there.
        if (found.length === 0) await page.evaluate((parts) => api.load(parts), parts);
        for (const shade of [true, false]) {
            const { light, clip, background } = scene, { material } = scene.function;
            const look = { function: { ...scene.function, material: { ...material, shade } }, light, clip, background };
            const { text } = await page.evaluate(([view, look, quality, size]) =>
                // @ts-expect-error: drawing.ts puts it there.
                api.picture(view, look, [], quality, size, size) as { text: string },
            [viewOf(scene.camera, 1), look as unknown as Look, QUALITY, SIZE] as const);
            const quality = ['--mode', 'decoded', '--step', '0.25', '--size', `${SIZE}x${SIZE}`];
            const shown = ['--tf', tf, '--shade', shade ? 'on' : 'off', ...camera, ...quality];
            vgs('render', splats, '-o', picture, '-f', '-q', ...shown);
            const ours = Buffer.from(text, 'base64'), theirs = PNG.sync.read(readFileSync(picture)).data;
            found.push(likeness(ours, theirs));
        }
    }
    await close();
    return found;
}

/** Bytes of the page, and ms from its opening to the first and to the finished picture. */
async function times(browser: Browser, splats: string): Promise<number[]> {
    const file = join(scratch, 'page.html');
    vgs('convert', splats, '-o', file, '-f', '-q');
    const html = readFileSync(file, 'utf8');
    const { page, close } = await open(browser, html, { width: 960, height: 600 });
    const shown = await page.waitForFunction(
        () => document.getElementById('progress')?.hidden && performance.now(), null,
        { timeout: 300_000, polling: 20 });
    const first = await shown.jsonValue() as number;
    // The line below the picture grows while it is refined.
    const done = await page.waitForFunction(() => {
        const share = parseFloat(document.getElementById('refined')!.style.width);
        const seen = document.body.dataset;
        if (share > 0) seen['refined'] = 'yes';
        return seen['refined'] && !(share > 0) && performance.now();
    }, null, { timeout: 300_000, polling: 50 });
    const finished = await done.jsonValue() as number;
    await close();
    return [html.length, first, finished];
}

const head = [
    'case', 'splats', 'vgs_bytes', 'page_bytes', 'v_rms_hu', 'v_worst_hu', 'voxels_with_wrong_o',
    ...FUNCTIONS.flatMap((tf) => ['lit', 'unlit'].map((light) => `${tf.toLowerCase().replaceAll('-', '_')}_${light}_db`)),
    'first_picture_ms', 'finished_picture_ms', 'browser', 'cores',
].join(',');
const browser = await launch();
const rows = [];
for (const argument of process.argv.slice(2)) {
    const [name, splats, volume] = argument.split(/[=,]/);
    const found = differences(splats, volume, scratch);
    const told = found ? [found.rms.toFixed(3), found.worst.toFixed(2), found.wrong] : ['', '', ''];
    const like = await likenesses(browser, splats);
    const [bytes, first, finished] = await times(browser, splats);
    const size = readFileSync(splats).length, count = readVgs(new Uint8Array(readFileSync(splats))).count;
    rows.push([
        name, count, size, bytes, ...told, ...like.map((db) => db.toFixed(1)),
        Math.round(first), Math.round(finished), `Chromium ${browser.version()} with SwiftShader`, availableParallelism(),
    ].join(','));
    console.log(rows[rows.length - 1]);
}
await browser.close();
rmSync(scratch, { recursive: true });
writeFileSync(new URL('../../../docs/results/data/page.csv', import.meta.url), `${[head, ...rows].join('\n')}\n`);
