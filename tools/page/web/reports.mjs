// The table of what pages have measured: node reports.mjs makes docs/results/data/pages.csv of the reports in
// docs/results/pages (*.json, as *Measure* in a page shows them); with --check it says whether that is what is there.
import { readFileSync, readdirSync, writeFileSync } from 'node:fs';

const results = new URL('../../../docs/results/', import.meta.url).pathname;
const table = `${results}data/pages.csv`;

/** A field of a CSV. */
const field = (value) => (/[",\n]/.test(`${value}`) ? `"${`${value}`.replaceAll('"', '""')}"` : `${value}`);

/** The row of a report. */
function row(name) {
    const report = JSON.parse(readFileSync(`${results}pages/${name}`, 'utf8'));
    if (report.report !== 'vgs page 1') throw new Error(`${name} is no report of a page`);
    const times = report.looks.flatMap(({ drawMs, screenMs }) => [drawMs.p50, drawMs.p95, screenMs.p95]);
    const levels = report.looks.map(({ levels }) => Object.keys(levels).join(' / ')).join('; ');
    return [
        name.replace(/\.json$/, ''), report.device, report.browser, report.program, report.pixels.join(' x '),
        report.splats, report.voxels, report.pageBytes, report.firstPictureMs, ...times, levels, report.finishedMs,
    ].map(field).join(',');
}

const looks = ['lit', 'unlit', 'translucent'];
const head = [
    'report', 'device', 'browser', 'program', 'pixels', 'splats', 'voxels', 'page_bytes', 'first_picture_ms',
    ...looks.flatMap((look) => [`${look}_drawing_p50_ms`, `${look}_drawing_p95_ms`, `${look}_screen_p95_ms`]),
    'levels', 'finished_picture_ms',
].join(',');
const names = readdirSync(`${results}pages`).filter((name) => name.endsWith('.json')).sort();
const text = `${[head, ...names.map(row)].join('\n')}\n`;
if (!process.argv.includes('--check')) writeFileSync(table, text);
else if (readFileSync(table, 'utf8') !== text) {
    console.error('docs/results/data/pages.csv is not what the reports say: run node tools/page/web/reports.mjs');
    process.exit(1);
}
