// Makes GLSL ES 3.00 of the engine's own shaders, so that the page marches by the same lines as `vgs render`. What cannot
// be said there is put in other words, and nothing else:
//   - `#include` is followed, first to render/shaders, then to shaders-glsl/include
//   - constants of specialisation become plain ones, which the renderer replaces in the text (render/programs.ts)
//   - push constants become uniforms, buffers go: `name[i]` is `name_at(i)`, which inputs.glsl takes from an image
//   - a subgroup is one ray
import { readFileSync, existsSync } from 'node:fs';
import { join } from 'node:path';

const own = new URL('./render/shaders/', import.meta.url).pathname;
const engine = new URL('../../../shaders-glsl/include/', import.meta.url).pathname;

/** What the renderer takes as module 'shaders', and the files that it is made of. */
export function shaders() {
    const files = new Set();
    const named = (names) => Object.fromEntries(names.map((name) => [name.split('.')[0], translated(name, files)]));
    const texts = named(['library.glsl', 'march.frag', 'pick.frag', 'slice.frag', 'gradients.frag', 'whole.vert']);
    return { texts, files: [...files] };
}

/** The text of a shader in GLSL ES 3.00, without its first lines. */
function translated(name, files) {
    let text = included(name, files);
    text = text.replace(/\/\*[\s\S]*?\*\/|\/\/.*$/gm, '');
    text = text.replace(/^#extension.*$/gm, '');
    text = text.replace(/layout\(constant_id = \d+\) /g, '');
    const constants = /layout\(push_constant, scalar\) uniform (\w+) \{([^}]*)\} (\w+);/g;
    text = text.replace(constants, 'struct $1 {$2}; uniform $1 $3;');
    text = text.replace(buffer('View', 'views'), 'uniform View views[2];');
    const buffers = [];
    text = text.replace(buffer('(\\w+)', '(\\w+)'), (_, type, name) => {
        buffers.push(name);
        return `${type} ${name}_at(uint i);`;
    });
    text = text.replace(/layout\(binding = [^)]*\) uniform (\w+) (\w+);/g, 'uniform highp $1 $2;');
    for (const name of buffers) text = called(text, name);
    text = text.replace(/look_rows_at\(0u?\)/g, 'look_scene');
    text = text.replace('Look look_rows_at(uint i);', 'uniform Look look_scene; $&');
    text = text.replace(/\bsubgroup(Any|Min|Max)\(/g, '(');
    return squeezed(text);
}

/** The declaration of a buffer of rows of a type. */
const buffer = (type, name) => new RegExp(
    `layout\\(scalar, binding = [^)]*\\) readonly buffer \\w+ \\{ ${type} ${name}\\[\\]; \\};`, 'g');

function included(name, files) {
    const path = existsSync(join(own, name)) ? join(own, name) : join(engine, name);
    files.add(path);
    return readFileSync(path, 'utf8').replace(/^#include "(.*)"$/gm, (_, other) => included(other, files));
}

/** `name[…]` as `name_at(…)`, whatever brackets are within. */
function called(text, name) {
    const start = new RegExp(`\\b${name}\\[`);
    for (let found; (found = start.exec(text)); ) {
        let end = found.index + found[0].length, depth = 1;
        for (; depth > 0; end++) depth += { '[': 1, ']': -1 }[text[end]] ?? 0;
        const inside = text.slice(found.index + found[0].length, end - 1);
        text = `${text.slice(0, found.index)}${name}_at(${inside})${text.slice(end)}`;
    }
    return text;
}

/** Without spaces that mean nothing. Lines of the preprocessor stay lines. */
function squeezed(text) {
    const lines = text.split('\n').map((line) => line.trim()).filter((line) => line !== '');
    const joined = lines.map((line) => (line.startsWith('#') ? `\n${line}\n` : `${line} `)).join('');
    return joined.replace(/\n+/g, '\n').split('\n').map((line) =>
        line.startsWith('#') ? line : line.replace(/\s*([-+*/=<>!&|^%?:;,(){}[\]])\s*/g, '$1').trim()).join('\n').trim();
}
