#version 460
// Which bricks a look can show something of: those whose interval of intensity meets a visible entry of the
// table. An interval that ends before it begins stands for a brick outside the region. Writes 0 for a brick
// that can be seen and MOST for one that cannot: what occupancy_spread makes distances of. One invocation
// owns a brick.
#include "look_row.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform OccupancyParams { uint count; uint most; } p;
layout(scalar, binding = 0) readonly buffer LookRows { Look look_rows[]; };
layout(scalar, binding = 1) readonly buffer Visible { uint visible_before[]; };
layout(scalar, binding = 2) readonly buffer Intervals { vec2 intervals[]; };
layout(scalar, binding = 3) writeonly buffer Distances { uint distances[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    vec2 interval = intervals[i];
    bool visible = false;
    if (interval.x <= interval.y) {
        // The entries that points of this interval look up, and one more on each side: segments reach there.
        vec2 at = (interval - look_rows[0].first) * look_rows[0].inverse_step;
        vec2 entry = clamp(vec2(floor(at.x), ceil(at.y)), 0.0, look_rows[0].last);
        visible = visible_before[uint(entry.y) + 1] > visible_before[uint(entry.x)];
    }
    distances[i] = visible ? 0 : p.most;
}
