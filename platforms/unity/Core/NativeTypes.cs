using System;
using System.Runtime.InteropServices;

namespace DCloth
{
    // Fields are those of dcloth.h and dcloth_scene.h, which explain them. All are blittable: C reads what C# holds.

    /// <summary>Opaque; only pointers to it exist.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_model
    {
    }

    /// <summary>Opaque; only pointers to it exist.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_cloth
    {
    }

    /// <summary>Opaque; only pointers to it exist.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_scene
    {
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_error
    {
        public uint struct_size;
        public int status;
        public ulong offset_bytes;
        public fixed byte text[240];
        public ushort what_at;
        public ushort what_size;
        public ushort found_at;
        public ushort found_size;
        public ushort allowed_at;
        public ushort allowed_size;
        public ushort mend_at;
        public ushort mend_size;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_model_info
    {
        public uint struct_size;
        public uint joint_count;
        public uint vertex_count;
        public uint triangle_count;
        public uint stages;
        public float tick_seconds;
        public uint format_major;
        public uint format_minor;
        public byte* name;
        public byte* precision;
        public ushort* triangles;
        public float* positions;
        public ushort* coarse_vertices;
        public ushort* coarse_triangles;
        public uint coarse_vertex_count;
        public uint coarse_triangle_count;
        public float* texture_coordinates;
        public ushort* textured_triangles;
        public ushort* seam_vertices;
        public uint textured_vertex_count;
        public uint seam_vertex_count;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_space
    {
        public uint struct_size;
        public uint left;
        public uint up;
        public uint forward;
        public float metres_per_unit;
        public uint joint_frames;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_pose
    {
        public uint struct_size;
        public uint joint_count;
        public float* joint_matrices;
        public uint column_major;
        public uint padding;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_frame
    {
        public uint struct_size;
        public uint stages;
        public float seconds;
        public uint flags;
        public dcloth_error* error;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_cloth_info
    {
        public uint struct_size;
        public uint in_work;
        public float lag_seconds;
        public float tick_share;
        public uint frozen;
        public uint tick_waits;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_output
    {
        public uint struct_size;
        public uint vertex_count;
        public void* positions;
        public uint position_stride_bytes;
        public uint normal_stride_bytes;
        public void* normals;
        public void* tangents;
        public float* texture_coordinates;
        public uint tangent_stride_bytes;
        public uint texture_stride_bytes;
        public uint position_format;
        public uint normal_format;
        public uint tangent_format;
        public uint flags;
        public float* bounds;
        public void* scratch;
        public ulong scratch_size;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_timer
    {
        public uint struct_size;
        public IntPtr now; // uint64_t (*)(void* context)
        public void* context;
        public fixed ulong elapsed[Native.DCLOTH_TIMER_STEPS];
        public IntPtr piece; // void (*)(void* context, const char* name, uint64_t elapsed)
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_scene_character
    {
        public uint struct_size;
        public uint top_level;
        public dcloth_cloth* cloth;
        public float importance;
        public float draw_microseconds;
        public fixed float tick_microseconds[Native.DCLOTH_SCENE_LEVELS];
        public fixed float error_mm[Native.DCLOTH_SCENE_LEVELS];
        public float positions_microseconds;
        public float coarse_microseconds;
        public float undrawn_microseconds;
        public uint most_undrawn;
        public float plain_microseconds;
        public uint padding;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_scene_frame
    {
        public uint struct_size;
        public float seconds;
        public float budget_microseconds;
        public float spent_microseconds;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct dcloth_scene_choice
    {
        public uint struct_size;
        public uint level;
        public uint stages;
        public uint flags;
        public uint ticks;
        public float microseconds;
        public float stale_seconds;
        public uint draw;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_character
    {
        public uint struct_size;
        public uint joint_count;
        public byte** joint_names;
        public uint* joint_roles;
        public float* bind_matrices;
        public uint column_major;
        public uint body_vertex_count;
        public float* body_positions;
        public uint* body_joints;
        public float* body_weights;
        public uint* body_triangles;
        public uint body_influences;
        public uint body_triangle_count;
    }

    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct dcloth_fit
    {
        public uint struct_size;
        public uint warnings;
        public float scale;
        public float bone_scale;
        public float waist_ratio;
        public float hips_ratio;
        public float gap_mm;
        public float penetration_mm;
        public float penetrating_share;
        public float stance_degrees;
        public uint stance_role;
        public uint stand_in_role;
        public fixed float ratios[Native.DCLOTH_FIT_ROLES];
        public fixed int joints[Native.DCLOTH_FIT_ROLES];
        public ulong file_bytes;
    }
}
