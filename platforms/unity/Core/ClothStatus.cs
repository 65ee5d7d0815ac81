using System;

namespace DCloth
{
    /// <summary>DCLOTH_OK and DCLOTH_ERROR_*.</summary>
    public enum ClothStatus
    {
        Ok = Native.DCLOTH_OK,
        Argument = Native.DCLOTH_ERROR_ARGUMENT,
        Alignment = Native.DCLOTH_ERROR_ALIGNMENT,
        Memory = Native.DCLOTH_ERROR_MEMORY,
        Format = Native.DCLOTH_ERROR_FORMAT,
        Version = Native.DCLOTH_ERROR_VERSION,
        Semantics = Native.DCLOTH_ERROR_SEMANTICS,
        Pose = Native.DCLOTH_ERROR_POSE,
        Joints = Native.DCLOTH_ERROR_JOINTS,
        Model = Native.DCLOTH_ERROR_MODEL
    }

    /// <summary>Which stages run; fewer are a level of detail. DCLOTH_STAGES_*.</summary>
    public enum ClothStages : uint
    {
        Static = Native.DCLOTH_STAGES_STATIC,
        Skeleton = Native.DCLOTH_STAGES_SKELETON,
        Mesh = Native.DCLOTH_STAGES_MESH
    }

    /// <summary>What the engine refused while something was set up. Frames never throw: they return a status.</summary>
    public sealed unsafe class ClothException : Exception
    {
        public ClothException(ClothStatus status, ulong offsetBytes, string message) : base(message)
        {
            Status = status;
            OffsetBytes = offsetBytes;
        }

        public ClothStatus Status { get; }

        /// <summary>Where in the model's or state's bytes; ulong.MaxValue where no place applies.</summary>
        public ulong OffsetBytes { get; }

        internal static dcloth_error NewError()
        {
            return new dcloth_error { struct_size = (uint)sizeof(dcloth_error) };
        }

        internal static void ThrowUnlessOk(int status, dcloth_error* error, string what)
        {
            if (status == Native.DCLOTH_OK) return;
            ulong offset = error == null ? ulong.MaxValue : error->offset_bytes;
            string text = error == null ? "" : Utf8.Text(error->text);
            throw new ClothException((ClothStatus)status, offset,
                                     what + ": " + (text.Length > 0 ? text : "refused with " + (ClothStatus)status));
        }
    }
}
