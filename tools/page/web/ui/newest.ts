// What takes a while and is wanted again and again, as what lies under a cursor that moves.

export interface Newest<Wanted> {
    want(wanted: Wanted): void;
    /** Wants nothing any more, and nothing of what is under way. */
    forget(): void;
}

/**
 * Finds one thing at a time; what was wanted last meanwhile is found afterwards, and what came between never.
 */
export function newest<Wanted, Found>(
    find: (wanted: Wanted) => Promise<Found | null>,
    found: (result: Found | null, wanted: Wanted) => void,
): Newest<Wanted> {
    let next: { wanted: Wanted } | null = null;
    let running = false;
    let forgotten = 0;
    const run = async () => {
        running = true;
        while (next) {
            const { wanted } = next;
            const before = forgotten;
            next = null;
            const result = await find(wanted).catch(() => null);
            if (before === forgotten) found(result, wanted);
        }
        running = false;
    };
    return {
        want(wanted) {
            next = { wanted };
            if (!running) void run();
        },
        forget() {
            next = null;
            forgotten++;
        },
    };
}
