// Unpacks style and program of the page and starts it; the rest of the page says what is missing where that does not work.
import { bytesOf } from './text.ts';

async function load(): Promise<void> {
    document.getElementById('cut-off')?.remove();
    const packed = document.getElementById('program')!;
    const bytes = bytesOf(packed.textContent!, Number(packed.dataset.bytes));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
    const [style, script] = (await new Response(stream).text()).split('\0');
    document.querySelector('style')!.remove();
    for (const [name, text] of [['style', style], ['script', script]]) {
        const element = document.createElement(name);
        element.textContent = text;
        document.body.append(element);
    }
}

load().catch(() => {
    const message = document.getElementById('message');
    if (message) message.textContent = 'This page needs a browser of 2023 or later, or it was damaged on its way.';
});
