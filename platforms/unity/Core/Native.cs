using System;
using System.Runtime.InteropServices;

namespace DCloth
{
    /// <summary>The C ABI of dcloth.h and dcloth_scene.h, one to one: names, order and meaning are the headers'.
    /// Nothing here is marshalled: every parameter is a number or a pointer. Checked against engine/abi.json.</summary>
    public static unsafe partial class Native
    {
        // Players that allow no libraries of their own link dcloth into the program (libdcloth.a in Plugins).
#if (UNITY_IOS || UNITY_TVOS || UNITY_VISIONOS || UNITY_WEBGL) && !UNITY_EDITOR
        public const string Library = "__Internal";
#else
        public const string Library = "dcloth";
#endif
        private const CallingConvention C = CallingConvention.Cdecl;

        [DllImport(Library, CallingConvention = C)]
        public static extern byte* dcloth_version();

        [DllImport(Library, CallingConvention = C)]
        public static extern uint dcloth_version_number();

        [DllImport(Library, CallingConvention = C)]
        public static extern byte* dcloth_status_name(int status);

        [DllImport(Library, CallingConvention = C)]
        public static extern byte* dcloth_isa_name();

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_isa_select(byte* name);

        [DllImport(Library, CallingConvention = C)]
        public static extern UIntPtr dcloth_model_storage_size();

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_model_open(void* bytes, UIntPtr size, void* storage, UIntPtr storage_size,
                                                   dcloth_model** model, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_model_describe(dcloth_model* model, dcloth_model_info* info);

        [DllImport(Library, CallingConvention = C)]
        public static extern byte* dcloth_model_joint_name(dcloth_model* model, uint index);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_model_joint_parent(dcloth_model* model, uint index);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_model_joint_bind(dcloth_model* model, uint index, float* matrix);

        [DllImport(Library, CallingConvention = C)]
        public static extern uint dcloth_model_body_vertex_count(dcloth_model* model);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_model_output(dcloth_model* model, dcloth_output* output);

        [DllImport(Library, CallingConvention = C)]
        public static extern uint dcloth_model_reads_wind(dcloth_model* model);

        [DllImport(Library, CallingConvention = C)]
        public static extern UIntPtr dcloth_cloth_storage_size(dcloth_model* model);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_create(dcloth_model* model, void* storage, UIntPtr storage_size,
                                                     dcloth_cloth** cloth, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_bind_joints(dcloth_cloth* cloth, byte** names, uint count,
                                                          dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_set_space(dcloth_cloth* cloth, dcloth_space* space, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_set_bind_pose(dcloth_cloth* cloth, dcloth_pose* bind,
                                                            dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_set_fit(dcloth_cloth* cloth, void* fit, UIntPtr size,
                                                      dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_set_wind(dcloth_cloth* cloth, float* wind, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern ulong dcloth_output_scratch_size(dcloth_output* output);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_reset(dcloth_cloth* cloth);

        [DllImport(Library, CallingConvention = C)]
        public static extern UIntPtr dcloth_cloth_state_size(dcloth_cloth* cloth);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_save(dcloth_cloth* cloth, void* state, UIntPtr size, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_restore(dcloth_cloth* cloth, void* state, UIntPtr size, uint flags,
                                                      dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_update(dcloth_cloth* cloth, dcloth_pose* pose, dcloth_frame* frame,
                                                     dcloth_output* output, dcloth_timer* timer);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_describe(dcloth_cloth* cloth, dcloth_cloth_info* info);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_tick(dcloth_cloth* cloth, dcloth_pose* pose, uint stages,
                                                   dcloth_timer* timer);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_skin(dcloth_cloth* cloth, dcloth_pose* pose, float blend,
                                                   dcloth_output* output, dcloth_timer* timer);

        [DllImport(Library, CallingConvention = C)]
        public static extern UIntPtr dcloth_scene_storage_size(uint character_count);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_scene_create(uint character_count, void* storage, UIntPtr storage_size,
                                                     dcloth_scene** scene, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_scene_set(dcloth_scene* scene, uint index, dcloth_scene_character* character);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_scene_set_importance(dcloth_scene* scene, uint index, float importance);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_scene_plan(dcloth_scene* scene, dcloth_scene_frame* frame,
                                                   float* planned_microseconds);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_scene_get(dcloth_scene* scene, uint index, dcloth_scene_choice* choice);

        [DllImport(Library, CallingConvention = C)]
        public static extern int dcloth_cloth_fit(dcloth_cloth* cloth, dcloth_character* character, void* storage,
                                                  UIntPtr storage_size, dcloth_fit* fit, dcloth_error* error);

        [DllImport(Library, CallingConvention = C)]
        public static extern UIntPtr dcloth_fit_storage_size(dcloth_model* model, dcloth_character* character);

        [DllImport(Library, CallingConvention = C)]
        public static extern byte* dcloth_role_name(uint role);

        [DllImport(Library, CallingConvention = C)]
        public static extern uint dcloth_role_of_name(byte* name);
    }
}
