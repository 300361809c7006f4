#version 460
// Which splats a look can show: those whose interval of intensity meets a visible entry of the table and
// whose object is visible. One invocation owns a splat.
#include "appearance.glsl"
#include "look_row.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform ActivityParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer LookRows { Look look_rows[]; };
layout(scalar, binding = 1) readonly buffer Visible { uint visible_before[]; };
layout(scalar, binding = 2) readonly buffer Intervals { vec2 intervals[]; };
layout(scalar, binding = 3) readonly buffer Objects { uint objects[]; };
layout(scalar, binding = 4) readonly buffer Appearances { Appearance appearances[]; };
layout(scalar, binding = 5) writeonly buffer Flags { uint flags[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    // The entries that points of this interval look up, and one more on each side: pre-integrated segments
    // reach there.
    vec2 at = (intervals[i] - look_rows[0].first) * look_rows[0].inverse_step;
    vec2 entry = clamp(vec2(floor(at.x), ceil(at.y)), 0.0, look_rows[0].last);
    bool visible = visible_before[uint(entry.y) + 1] > visible_before[uint(entry.x)];
    // An interval that ends before it begins: a splat on which no transfer function acts.
    visible = visible || intervals[i].y < intervals[i].x;
    flags[i] = visible && appearances[objects[i]].visible != 0 ? 1 : 0;
}
