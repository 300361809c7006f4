// Starts the browser of tools/setup, and pages in it.
import { existsSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { type Browser, chromium, type Page } from 'playwright-core';
import { script } from '../build.mjs';

/** The folder of `tools/setup page`. */
const folder = process.env['VGS_PAGE'] ?? '';
/** Why there is no browser; false where there is one. */
export const missing = existsSync(join(folder, 'browser')) ? false : 'VGS_PAGE names no folder with a browser';

/** Starts it, with a software driver. */
export async function launch(): Promise<Browser> {
    const libraries = ['usr/lib/x86_64-linux-gnu', 'lib/x86_64-linux-gnu', 'usr/lib/x86_64-linux-gnu/pulseaudio'];
    return chromium.launch({
        executablePath: join(folder, 'browser/usr/lib/chromium/chromium-headless-shell'),
        env: {
            ...process.env as Record<string, string>,
            LD_LIBRARY_PATH: libraries.map((library) => join(folder, 'browser', library)).join(':'),
            FONTCONFIG_FILE: join(folder, 'browser/fonts.conf'),
        },
        args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
    });
}

/** Opens a file of the page in it; `trouble` gathers what it should not do: errors, messages, requests. */
export async function open(browser: Browser, html: string, size = { width: 1024, height: 768 }, touch = false)
    : Promise<{ page: Page; trouble: string[]; close: () => Promise<void> }> {
    const scratch = mkdtempSync(join(tmpdir(), 'vgs-page-'));
    const file = join(scratch, 'page.html');
    writeFileSync(file, html);
    const context = await browser.newContext({ viewport: size, hasTouch: touch });
    const page = await context.newPage();
    const trouble: string[] = [];
    page.on('console', (message) => trouble.push(`${message.type()}: ${message.text()}`));
    page.on('pageerror', (error) => trouble.push(`error: ${error.message}`));
    page.on('request', (request) => {
        const own = request.url().startsWith('file:') && request.isNavigationRequest();
        if (!own && !/^(blob|data):/.test(request.url())) trouble.push(`request: ${request.url()}`);
    });
    await page.goto(pathToFileURL(file).href);
    const close = async () => {
        await context.close();
        rmSync(scratch, { recursive: true });
    };
    return { page, trouble, close };
}

/** A page with nothing but a script of this folder. */
export async function harness(name: string): Promise<string> {
    const text = await script(new URL(name, import.meta.url).pathname, false);
    return `<!doctype html><meta charset="utf-8"><body><script>${text.replaceAll('</script', '<\\/script')}</script>`;
}
