// Builds the page: node build.mjs makes ../bundle/page.html of the sources here and of the engine's shaders; with
// --check it says whether that is what is there.
//
// The program is packed (deflate, then text), since a page is sent around: a few lines unpack it. Scripts and styles run
// only if they are the ones of the build (hashes in the policy), and nothing may be loaded from anywhere.
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { deflateRawSync } from 'node:zlib';
import esbuild from 'esbuild';
import { shaders } from './shaders.mjs';

const here = new URL('./', import.meta.url).pathname;
const levels = join(here, '../../../engine/render/src/quality_levels.toml');

/** The text of a script with all that it imports. */
export async function script(entry, minify = true) {
    const built = await esbuild.build({
        entryPoints: [entry], bundle: true, minify, write: false, format: 'iife', target: 'es2022', charset: 'utf8',
        plugins: [made], nodePaths: [join(here, 'node_modules')],
    });
    return built.outputFiles[0].text.trim();
}

/** Modules that are made of other sources. */
const made = {
    name: 'made',
    setup(build) {
        const filter = /^(shaders|quality-levels|worker-text)$/;
        build.onResolve({ filter }, ({ path }) => ({ path, namespace: 'made' }));
        build.onLoad({ filter: /.*/, namespace: 'made' }, async ({ path }) => {
            if (path === 'shaders') return { contents: JSON.stringify(shaders().texts), loader: 'json' };
            if (path === 'quality-levels') return { contents: JSON.stringify(gridLevels()), loader: 'json' };
            return { contents: await script(join(here, 'field/worker.ts')), loader: 'text' };
        });
    },
};

/** The levels of splats that were fitted for a grid. */
function gridLevels() {
    const [, ...rows] = readFileSync(levels, 'utf8').split('[[grid]]\n');
    const value = (row, key) => Number(new RegExp(`^${key} = ([\\d.]+)$`, 'm').exec(row)[1]);
    const keys = ['resolution', 'coarseness', 'cost'];
    return rows.map((row) => Object.fromEntries(keys.map((key) => [key, value(row, key)])));
}

/** Bytes as text: 13 bits in two of 91 printable characters, which HTML leaves as they are (text.ts). */
export function asText(bytes) {
    const letters = [...Array(94).keys()].map((i) => String.fromCharCode(33 + i)).filter((c) => !'"&<'.includes(c));
    let text = '', bits = 0, held = 0;
    for (const byte of bytes) {
        held |= byte << bits;
        bits += 8;
        if (bits >= 13) {
            const value = held & 8191;
            text += letters[value % 91] + letters[Math.floor(value / 91)];
            held >>>= 13;
            bits -= 13;
        }
    }
    if (bits > 0) text += letters[held % 91] + letters[Math.floor(held / 91)];
    return text;
}

const css = async (text) => (await esbuild.transform(text, { loader: 'css', minify: true })).code.trim();
const hash = (text) => `'sha256-${createHash('sha256').update(text).digest('base64')}'`;

/** The page, with places for a title and a scene. */
export async function page() {
    const program = await script(join(here, 'main.ts'));
    const loader = await script(join(here, 'loader.ts'));
    const style = await css(readFileSync(join(here, 'page.css'), 'utf8'));
    // Until the other is unpacked.
    const first = await css(`body { background: #000; color: #ccc; font-family: sans-serif }
        svg, aside { display: none }
        #cut-off { visibility: hidden; animation: late 0s 8s forwards }
        @keyframes late { to { visibility: visible } }`);
    const policy = `default-src 'none'; script-src ${hash(loader)} ${hash(program)}; `
        + `style-src ${hash(first)} ${hash(style)}; img-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'`;
    const packed = deflateRawSync(Buffer.from(`${style}\0${program}`), { level: 9 });
    const fill = {
        policy, style: first, loader,
        program: `<script type="text/plain" id="program" data-bytes="${packed.length}">${asText(packed)}</script>`,
    };
    return readFileSync(join(here, 'page.html'), 'utf8').replace(/@(\w+)@/g, (found, name) => fill[name] ?? found);
}

if (process.argv[1] === new URL(import.meta.url).pathname) {
    const out = join(here, '../bundle/page.html');
    const text = await page();
    if (process.argv.includes('--check')) {
        if (readFileSync(out, 'utf8') !== text) {
            console.error('bundle/page.html is not what these sources make: run node build.mjs');
            process.exit(1);
        }
    } else {
        writeFileSync(out, text);
        console.log(`${out}: ${text.length} bytes`);
    }
}
