#!/usr/bin/env node
// Measures how near other programs' pictures of our splats are to ours: docs/results/data/other-viewers.csv.
//
// It writes standard splats in each format that other programs read, opens each file in each viewer, in a browser without
// a window, with three cameras, and compares what the viewer shows with `vgs render --mode alpha` of the same file: PSNR
// over the whole picture of 512 x 512 pixels on black, in dB, the peak being 255. .compressed.ply and .sog are written by
// @playcanvas/splat-transform, and vgs draws what that reads in them again. A viewer is as its authors have it; another
// row has settings that bring it nearer, and notes say what else it does otherwise. Ends with 1 if a viewer fails
// that is not known to.
//
// usage: node tests/outsiders/viewers.mjs VGS SPLATS.ply [PICTURES]
//        VGS is the program, by its path (tools/vgs, say); SPLATS.ply a file of `vgs convert FIT -o SPLATS.ply --tf PRESET`;
//        PICTURES a new folder for all pictures
//        ONLY=spark,glb in the environment leaves out other viewers and formats, and keeps the table as it is;
//        BAKED='FIT.ply --tf PRESET', for SPLATS.ply of `vgs bake FIT.ply --tf PRESET`, also compares both with
//        `vgs render FIT.ply --tf PRESET --mode decoded`: baked-viewers.csv beside that table
// Needs VGS_PAGE, the folder of `tools/setup page` (VGS_PAGE=$(tools/setup --where page); $VGS_PAGE/node/bin/node runs
// this) and, the first time, npm's registry: the packages of viewers/package-lock.json, 400 MB, go into a folder of
// VGS_PAGE. Takes about ten minutes on two cores.
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { copyFileSync, cpSync, existsSync, mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { dirname, extname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const SIZE = 512;
const HERE = dirname(fileURLToPath(import.meta.url));
const BAKED = process.env.BAKED?.split(' ');
const TABLE = join(HERE, '../../docs/results/data', BAKED ? 'baked-viewers.csv' : 'other-viewers.csv');

/** From mm RAS to the axes and units of a format (docs/design/file-formats.md). */
const AXES = {
    'ply': (v) => v,
    'spz': ([x, y, z]) => [x / 1000, z / 1000, -y / 1000],
    'glb': ([x, y, z]) => [-x / 1000, z / 1000, y / 1000],
    'compressed.ply': (v) => v,
    'sog': (v) => v,
};
const FORMATS = Object.keys(AXES);

/** Where cameras are, from the middle of the splats. */
const VIEWS = { 'anterior': [0, 1, 0], 'left': [-1, 0, 0], 'anterior-left-superior': [-1, 1, 0.8] };

/** The viewers of viewers/pages.js: their packages, what they read, their options, and what they do otherwise. */
const THREE = { page: 'three', package: 'three', formats: ['ply', 'spz', 'glb'] };
const SPARK = { page: 'spark', package: '@sparkjsdev/spark', formats: ['ply', 'spz', 'compressed.ply', 'sog'] };
const VIEWERS = [
    { ...THREE, note: 'takes colours for linear light; as below' },
    { ...THREE, options: { linear: true }, note: 'outputColorSpace linear; ends splats at 2 sigma; dims narrow ones' },
    { ...SPARK, note: 'dims narrow splats; sorts by distance' },
    { ...SPARK, options: { preBlurAmount: 0.3, blurAmount: 0, sortRadial: false },
        note: 'preBlurAmount 0.3; blurAmount 0; sortRadial false' },
    { page: 'mkkellogg', package: '@mkkellogg/gaussian-splats-3d', formats: ['ply', 'spz', 'compressed.ply'],
        note: 'sphericalHarmonicsDegree 2; opacities and colours in bytes; ends at 2.83 sigma',
        fails: { 'spz': 'reads versions 1 and 2', 'compressed.ply': 'loses the harmonics or shows nothing' } },
    { page: 'supersplat', package: '@playcanvas/supersplat-viewer', formats: ['ply', 'compressed.ply', 'sog'],
        note: 'subtracts exp(-4) from the profile; sorts by distance' },
    { page: 'playcanvas', package: 'playcanvas', formats: ['ply', 'glb', 'compressed.ply', 'sog'],
        note: 'subtracts exp(-4) from the profile' },
    { page: 'babylon', package: 'babylonjs', formats: FORMATS, note: 'opacities and colours in bytes; ends at 2.83 sigma' },
];

const [vgs, splats, pictures] = process.argv.slice(2);
const setup = process.env.VGS_PAGE;
if (!splats || !setup) {
    console.log(readFileSync(fileURLToPath(import.meta.url), 'utf8').split('\n').filter((line) => /^\/\//.test(line))
        .map((line) => line.slice(3)).join('\n'));
    process.exit(2);
}
const require = createRequire(join(setup, 'package.json'));
const { chromium } = require('playwright-core');
const { PNG } = require('pngjs');

function run(program, ...words) {
    return execFileSync(program, words, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] });
}

/** Installs the viewers, unless they are there; returns the folder of their packages. */
function installed() {
    const lock = readFileSync(join(HERE, 'viewers/package-lock.json'));
    const folder = join(setup, `viewers-${createHash('sha256').update(lock).digest('hex').slice(0, 12)}`);
    if (!existsSync(folder)) {
        console.log('installing the viewers ...');
        const part = mkdtempSync(join(setup, 'viewers-part-'));
        const copy = (name) => copyFileSync(join(HERE, 'viewers', name), join(part, name));
        ['package.json', 'package-lock.json'].forEach(copy);
        const npm = join(setup, 'node/lib/node_modules/npm/bin/npm-cli.js');
        run(process.execPath, npm, 'ci', '--prefix', part, '--ignore-scripts', '--no-audit', '--no-fund');
        renameSync(part, folder);
    }
    return join(folder, 'node_modules');
}

const MODULES = (page) => ({
    'three': `/m/three/build/${page === 'three' ? 'three.webgpu.js' : 'three.module.js'}`,
    'three/webgpu': '/m/three/build/three.webgpu.js',
    'three/tsl': '/m/three/build/three.tsl.js',
    'three/addons/': '/m/three/examples/jsm/',
    '@sparkjsdev/spark': '/m/@sparkjsdev/spark/dist/spark.module.js',
    'fflate': '/m/fflate/esm/browser.js',
    '@mkkellogg/gaussian-splats-3d': '/m/@mkkellogg/gaussian-splats-3d/build/gaussian-splats-3d.module.js',
    'playcanvas': '/m/playcanvas/build/playcanvas.mjs',
    'playcanvas/': '/m/playcanvas/',
    '@playcanvas/supersplat-viewer/viewer': '/m/@playcanvas/supersplat-viewer/dist/viewer.js',
    '@playcanvas/supersplat-viewer/settings': '/m/@playcanvas/supersplat-viewer/dist/settings.js',
});

/** Serves a page for each viewer, the packages (/m/) and the splats (/f/); returns the address. */
async function serve(packages, files) {
    const html = (page) => `<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
        <style>body { margin: 0; background: #000 } canvas { display: block }</style>
        <script type="importmap">${JSON.stringify({ imports: MODULES(page) })}</script>
        <script type="module" src="/pages.js"></script>`;
    const script = 'text/javascript';
    const types = { '': 'text/html', '.js': script, '.mjs': script, '.css': 'text/css', '.wasm': 'application/wasm' };
    const server = createServer((request, response) => {
        const path = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
        const [, kind, ...rest] = path.split('/');
        try {
            const folder = { 'm': packages, 'f': files, 'pages.js': join(HERE, 'viewers/pages.js') }[kind];
            const body = kind === 'page' ? html(rest[0]) : readFileSync(join(folder, ...rest));
            const type = types[extname(path)] ?? 'application/octet-stream';
            response.writeHead(200, { 'Content-Type': type, 'Content-Length': Buffer.byteLength(body) }).end(body);
        } catch {
            response.writeHead(404).end();
        }
    });
    await new Promise((done) => server.listen(0, '127.0.0.1', done));
    return { server, address: `http://127.0.0.1:${server.address().port}` };
}

/** The browser, with a software driver, as in tools/page/web/tests/browser.ts. */
async function launch() {
    const libraries = ['usr/lib/x86_64-linux-gnu', 'lib/x86_64-linux-gnu', 'usr/lib/x86_64-linux-gnu/pulseaudio'];
    return chromium.launch({
        executablePath: join(setup, 'browser/usr/lib/chromium/chromium-headless-shell'),
        env: {
            ...process.env,
            LD_LIBRARY_PATH: libraries.map((path) => join(setup, 'browser', path)).join(':'),
            FONTCONFIG_FILE: join(setup, 'browser/fonts.conf'),
        },
        args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
            '--force-color-profile=srgb'],
    });
}

/** Writes the splats in each format; returns the files that vgs draws in their place. */
function write(folder, packages) {
    const file = (format) => join(folder, `splats.${format}`);
    copyFileSync(splats, file('ply'));
    for (const format of ['spz', 'glb']) run(vgs, 'convert', file('ply'), '-o', file(format));
    const ours = Object.fromEntries(FORMATS.map((format) => [format, file(format)]));
    const transform = join(packages, '@playcanvas/splat-transform/bin/cli.mjs');
    for (const format of ['compressed.ply', 'sog']) {
        ours[format] = join(folder, `again-${format.split('.')[0]}.ply`);
        run(process.execPath, transform, '-w', '-g', 'cpu', file('ply'), file(format));
        run(process.execPath, transform, '-w', file(format), ours[format]);
    }
    return ours;
}

/** The cameras, in mm RAS: at a distance that shows all. */
function cameras() {
    const [low, high] = JSON.parse(run(vgs, 'info', splats, '--json')).bounding_box_mm;
    const target = low.map((v, k) => (v + high[k]) / 2);
    const radius = Math.hypot(...low.map((v, k) => (high[k] - v) / 2));
    return Object.fromEntries(Object.entries(VIEWS).map(([name, side]) => {
        const away = radius / Math.sin(15 * Math.PI / 180) / Math.hypot(...side);
        return [name, { eye: target.map((v, k) => v + away * side[k]), target, up: [0, 0, 1], fov: 30 }];
    }));
}

/** What a viewer shows, once it is the same twice, half a second apart, and not empty. */
async function shown(browser, address, { viewer, format, camera }) {
    const page = await browser.newPage({ viewport: { width: SIZE, height: SIZE } });
    const trouble = [];
    page.on('console', (message) => message.type() === 'error' && trouble.push(message.text()));
    page.on('pageerror', (error) => trouble.push(error.message));
    try {
        await page.goto(`${address}/page/${viewer.page}`, { waitUntil: 'load' });
        await page.waitForFunction(() => window.show);
        const axes = AXES[format];
        const turned = { eye: axes(camera.eye), target: axes(camera.target), up: axes(camera.up), fov: camera.fov };
        const kind = format.split('.').pop();
        const what = { viewer: viewer.page, url: `/f/splats.${format}`, kind, camera: turned, options: viewer.options };
        const tooLong = new Error('it does not open in two minutes');
        const late = new Promise((_, fail) => setTimeout(fail, 120_000, tooLong).unref());
        await Promise.race([page.evaluate((what) => window.show(what), what), late]);
        let last;
        for (let tries = 0; tries < 100; ++tries) {
            const picture = Buffer.from((await page.evaluate(() => window.taken())).split(',')[1], 'base64');
            const empty = () => PNG.sync.read(picture).data.every((v, k) => k % 4 === 3 || v <= 8);
            if (last && picture.equals(last) && !empty()) return picture;
            last = picture;
            await page.waitForTimeout(500);
        }
        throw new Error('it shows nothing, or does not come to rest');
    } catch (error) {
        throw new Error([error.message.split('\n')[0], ...trouble].join('; ').slice(0, 300));
    } finally {
        await page.close();
    }
}

function psnr(a, b) {
    const [x, y] = [a, b].map((data) => PNG.sync.read(data).data);
    let sum = 0;
    for (let k = 0; k < x.length; ++k) if (k % 4 < 3) sum += (x[k] - y[k]) ** 2;
    return -10 * Math.log10(sum / (SIZE * SIZE * 3) / 255 ** 2);
}

const packages = installed();
const version = (name) => JSON.parse(readFileSync(join(packages, name, 'package.json'), 'utf8')).version;
const folder = mkdtempSync(join(tmpdir(), 'vgs-viewers-'));
const ours = write(folder, packages);
const { server, address } = await serve(packages, folder);
const browser = await launch();
const only = process.env.ONLY?.split(',') ?? [];
const wanted = (name, all) => only.includes(name) || !only.some((other) => all.includes(other));
const pages = VIEWERS.map((viewer) => viewer.page);
const rows = [];
for (const [view, camera] of Object.entries(cameras())) {
    const json = join(folder, `${view}.json`);
    const { eye, target, up, fov } = camera;
    writeFileSync(json, JSON.stringify({ eye_mm: eye, target_mm: target, up, fov_deg: fov }));
    const render = (picture, ...words) =>
        run(vgs, 'render', ...words, '--camera', json, '--size', `${SIZE}x${SIZE}`, '-o', picture);
    const decoded = join(folder, `${view}-decoded.png`);
    if (BAKED) render(decoded, ...BAKED, '--mode', 'decoded');
    for (const format of FORMATS.filter((format) => wanted(format, FORMATS))) {
        const picture = join(folder, `${view}-${format}-vgs.png`);
        render(picture, ours[format], '--mode', 'alpha');
        for (const viewer of VIEWERS.filter(({ page, formats }) => formats.includes(format) && wanted(page, pages))) {
            const { page, package: name, options, note, fails } = viewer;
            const row = { viewer: name, version: version(name), format, view, psnr_db: '' };
            if (BAKED) Object.assign(row, { decoded_db: '', vgs_decoded_db: '' });
            row.note = note;
            if (fails?.[format]) row.note = `fails: ${fails[format]}`;
            else try {
                const theirs = await shown(browser, address, { viewer, format, camera });
                writeFileSync(join(folder, `${view}-${format}-${page}${options ? '-set' : ''}.png`), theirs);
                const mine = readFileSync(picture);
                row.psnr_db = psnr(theirs, mine).toFixed(1);
                const near = (shown) => psnr(shown, readFileSync(decoded)).toFixed(1);
                if (BAKED) Object.assign(row, { decoded_db: near(theirs), vgs_decoded_db: near(mine) });
            } catch (error) {
                row.note = `fails: ${error.message.replaceAll(/[",\n]/g, ' ')}`;
                process.exitCode = 1;
            }
            rows.push(row);
            console.log(Object.values(row).join('  '));
        }
    }
}
await browser.close();
server.close();
const columns = Object.keys(rows[0]);
const lines = [columns, ...rows.map((row) => Object.values(row))].map((cells) => `${cells.join(',')}\n`);
if (!only.length) writeFileSync(TABLE, lines.join(''));
if (pictures) cpSync(folder, resolve(pictures), { recursive: true });
rmSync(folder, { recursive: true });

console.log(`\n| viewer, least dB of its views | ${FORMATS.join(' | ')} | |\n|${'---|'.repeat(FORMATS.length + 2)}`);
for (const { package: name, note } of VIEWERS) {
    const cells = FORMATS.map((format) => {
        const of = rows.filter((row) => row.viewer === name && row.format === format && (row.note === note || !row.psnr_db));
        return of.length ? Math.min(...of.map((row) => Number(row.psnr_db))) || 'fails' : '';
    });
    if (cells.some((cell) => cell !== '')) console.log(`| ${name} ${version(name)} | ${cells.join(' | ')} | ${note} |`);
}
