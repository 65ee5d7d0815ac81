using System;
using System.Collections.Generic;

namespace DCloth
{
    /// <summary>One garment on one character, in memory of its own. (UnityEngine has a Cloth already.) Set-up throws
    /// ClothException; frames return a status and make no garbage.
    /// Thread: one at a time; different cloths at once are fine.</summary>
    public sealed unsafe class ClothInstance : IDisposable
    {
        private readonly ClothModel model;
        private readonly AlignedMemory storage;
        private AlignedMemory fitStorage;
        private dcloth_cloth* cloth;

        public ClothInstance(ClothModel model)
        {
            this.model = model ?? throw new ArgumentNullException(nameof(model));
            dcloth_model* handle = model.Handle;
            storage = new AlignedMemory(model.ClothBytes);
            dcloth_error error = ClothException.NewError();
            dcloth_cloth* created = null;
            int status = Native.dcloth_cloth_create(handle, storage.Start, (UIntPtr)(ulong)storage.Size, &created,
                                                    &error);
            if (status != Native.DCLOTH_OK) storage.Dispose();
            ClothException.ThrowUnlessOk(status, &error, model.Name);
            cloth = created;
            model.Retain();
        }

        public ClothModel Model => model;

        /// <summary>For calls of Native that have no method here. Keep this object alive meanwhile.</summary>
        public dcloth_cloth* Handle
        {
            get
            {
                if (cloth == null) throw new ObjectDisposedException(nameof(ClothInstance));
                return cloth;
            }
        }

        public void SetSpace(dcloth_space space)
        {
            dcloth_error error = ClothException.NewError();
            int status = Native.dcloth_cloth_set_space(Handle, &space, &error);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, &error, model.Name);
        }

        /// <summary>Poses hold one matrix per name from now on. Errors: Joints, with the names that are
        /// missing.</summary>
        public void BindJoints(IReadOnlyList<string> names)
        {
            if (names == null) throw new ArgumentNullException(nameof(names));
            dcloth_error error = ClothException.NewError();
            int status;
            using (AlignedMemory table = Utf8.Table(names))
                status = Native.dcloth_cloth_bind_joints(Handle, (byte**)table.Start, (uint)names.Count, &error);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, &error, model.Name);
        }

        /// <summary>For joints with axes or scale of their own: the character's bind pose as it is here. Errors: Pose,
        /// with the joint that has no inverse.</summary>
        public void SetBindPose(dcloth_pose* bind)
        {
            dcloth_error error = ClothException.NewError();
            int status = Native.dcloth_cloth_set_bind_pose(Handle, bind, &error);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, &error, model.Name);
        }

        /// <summary>Fits the garment to a character with other bones, axes, bind pose and girth; set the space before.
        /// It takes the place of BindJoints and SetBindPose. The result says how it fits. Errors: Joints for parts that
        /// the skeleton lacks, Pose for a rig that would crumple the garment, Argument; the cloth is then as it was.
        /// Cost: 50 us; with a body 0.2 to 1 s.</summary>
        public dcloth_fit Fit(ClothCharacter character)
        {
            if (character == null) throw new ArgumentNullException(nameof(character));
            character.Check(model.Name);
            dcloth_error error = ClothException.NewError();
            var fit = new dcloth_fit { struct_size = (uint)sizeof(dcloth_fit) };
            AlignedMemory needed;
            int status;
            using (AlignedMemory names = Utf8.Table(character.BoneNames))
            fixed (float* bind = character.BindMatrices, positions = character.BodyPositions,
                   weights = character.BodyWeights)
            fixed (uint* roles = character.BoneRoles, bones = character.BodyBones, triangles = character.BodyTriangles)
            {
                var told = new dcloth_character
                {
                    struct_size = (uint)sizeof(dcloth_character),
                    joint_count = (uint)character.BoneNames.Count,
                    joint_names = (byte**)names.Start,
                    joint_roles = roles,
                    bind_matrices = bind,
                    column_major = 1,
                    body_vertex_count = (uint)character.BodyCount,
                    body_positions = positions,
                    body_joints = bones,
                    body_weights = weights,
                    body_triangles = triangles,
                    body_influences = character.BodyCount == 0 ? 0 : (uint)character.BodyInfluences,
                    body_triangle_count = triangles == null ? 0 : (uint)character.BodyTriangles.Length / 3,
                };
                UIntPtr size = Native.dcloth_fit_storage_size(model.Handle, &told);
                needed = new AlignedMemory((long)(ulong)size);
                status = Native.dcloth_cloth_fit(Handle, &told, needed.Start, size, &fit, &error);
            }
            KeepFit(needed, status, &error);
            return fit;
        }

        /// <summary>Lays the garment onto another character, by the bytes of a file of `dcloth dress HERO -o
        /// HERO.dcloth-fit`; set the space before. The pose then holds that character's joints in its own order;
        /// BindJoints after it chooses others. Errors: Model for the fit of another garment, Format, Version,
        /// Semantics; the cloth is then as it was.</summary>
        public void SetFit(byte[] fit)
        {
            dcloth_error error = ClothException.NewError();
            AlignedMemory bytes = AlignedMemory.CopyOf(fit);
            int status = Native.dcloth_cloth_set_fit(Handle, bytes.Start, (UIntPtr)(ulong)bytes.Size, &error);
            KeepFit(bytes, status, &error);
        }

        private void KeepFit(AlignedMemory fit, int status, dcloth_error* error)
        {
            GC.KeepAlive(this);
            if (status != Native.DCLOTH_OK) fit.Dispose();
            ClothException.ThrowUnlessOk(status, error, model.Name);
            fitStorage?.Dispose(); // of the fit before
            fitStorage = fit;
        }

        /// <summary>In host units a second along the host's axes, at most 100 m/s; for ticks from now on. Models
        /// without ReadsWind ignore it. Errors: Argument; the wind before stays.</summary>
        public ClothStatus SetWind(float x, float y, float z)
        {
            float* wind = stackalloc float[3];
            wind[0] = x;
            wind[1] = y;
            wind[2] = z;
            int status = Native.dcloth_cloth_set_wind(Handle, wind, null);
            GC.KeepAlive(this);
            return (ClothStatus)status;
        }

        public void Reset()
        {
            int status = Native.dcloth_cloth_reset(Handle);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, null, model.Name);
        }

        /// <summary>Runs the ticks that are due and draws; `output` and `timer` may be null. A refused frame changes
        /// nothing.</summary>
        public ClothStatus Update(dcloth_pose* pose, dcloth_frame* frame, dcloth_output* output,
                                  dcloth_timer* timer = null)
        {
            int status = Native.dcloth_cloth_update(Handle, pose, frame, output, timer);
            GC.KeepAlive(this);
            return (ClothStatus)status;
        }

        public ClothStatus Tick(dcloth_pose* pose, ClothStages stages, dcloth_timer* timer = null)
        {
            int status = Native.dcloth_cloth_tick(Handle, pose, (uint)stages, timer);
            GC.KeepAlive(this);
            return (ClothStatus)status;
        }

        public ClothStatus Skin(dcloth_pose* pose, float blend, dcloth_output* output, dcloth_timer* timer = null)
        {
            int status = Native.dcloth_cloth_skin(Handle, pose, blend, output, timer);
            GC.KeepAlive(this);
            return (ClothStatus)status;
        }

        /// <summary>What the last update did.</summary>
        public dcloth_cloth_info Describe()
        {
            var info = new dcloth_cloth_info { struct_size = (uint)sizeof(dcloth_cloth_info) };
            int status = Native.dcloth_cloth_describe(Handle, &info);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, null, model.Name);
            return info;
        }

        /// <summary>All that the frames to come depend on; joint binding, space and wind are not among it.</summary>
        public byte[] Save()
        {
            dcloth_error error = ClothException.NewError();
            var state = new byte[(long)(ulong)Native.dcloth_cloth_state_size(Handle)];
            int status;
            fixed (byte* bytes = state)
                status = Native.dcloth_cloth_save(Handle, bytes, (UIntPtr)(ulong)state.LongLength, &error);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, &error, model.Name);
            return state;
        }

        /// <summary>`otherModel` takes the state of another file with the same sizes. A refused state leaves the cloth
        /// as it was.
        /// Errors: Argument, Format, Version, Model, Semantics.</summary>
        public void Restore(byte[] state, bool otherModel = false)
        {
            if (state == null) throw new ArgumentNullException(nameof(state));
            dcloth_error error = ClothException.NewError();
            uint flags = otherModel ? Native.DCLOTH_RESTORE_OTHER_MODEL : 0;
            int status;
            fixed (byte* bytes = state)
                status = Native.dcloth_cloth_restore(Handle, bytes, (UIntPtr)(ulong)state.LongLength, flags, &error);
            GC.KeepAlive(this);
            ClothException.ThrowUnlessOk(status, &error, model.Name);
        }

        public void Dispose()
        {
            if (cloth == null) return;
            cloth = null;
            storage.Dispose();
            fitStorage?.Dispose();
            model.Release();
        }
    }
}
