namespace DCloth
{
    /// <summary>Axes and units of poses and vertices; see dcloth_space.</summary>
    public static unsafe class ClothSpace
    {
        /// <summary>The model's own: right-handed, +Y up, the character faces +Z, its left is +X, metres. glTF's
        /// too.</summary>
        public static dcloth_space Model => Make(Native.DCLOTH_AXIS_X, Native.DCLOTH_AXIS_Y, Native.DCLOTH_AXIS_Z, 1);

        /// <summary>Unity's: left-handed, +Y up, the character faces +Z, its left is -X, metres. As Unity's own
        /// importers do, x changes its sign: in positions, and in joints' axes.</summary>
        public static dcloth_space Unity =>
            Make(Native.DCLOTH_AXIS_MINUS_X, Native.DCLOTH_AXIS_Y, Native.DCLOTH_AXIS_Z, 1);

        public static dcloth_space Make(uint left, uint up, uint forward, float metresPerUnit)
        {
            return new dcloth_space
            {
                struct_size = (uint)sizeof(dcloth_space),
                left = left,
                up = up,
                forward = forward,
                metres_per_unit = metresPerUnit,
                joint_frames = Native.DCLOTH_JOINT_FRAMES_CONVERTED
            };
        }

        /// <summary>Whether the space is left-handed: triangles then go round the other way.</summary>
        public static bool IsLeftHanded(in dcloth_space space)
        {
            uint left = space.left / 2, up = space.up / 2;
            bool cyclic = (up + 3 - left) % 3 == 1;
            bool odd = (space.left + space.up + space.forward) % 2 == 1; // axes with a minus
            return cyclic == odd;
        }
    }
}
