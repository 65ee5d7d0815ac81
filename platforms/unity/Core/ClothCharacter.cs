using System;
using System.Collections.Generic;

namespace DCloth
{
    /// <summary>A character that the garment was not trained on, in its bind pose: a standing T or A pose, in the space
    /// of the cloth. What dcloth_character of dcloth_fit.h holds; without a body the garment follows bones
    /// alone.</summary>
    public sealed class ClothCharacter
    {
        /// <summary>The whole skeleton; poses then hold one matrix per name.</summary>
        public IReadOnlyList<string> BoneNames { get; set; }

        /// <summary>[BoneNames.Count, 16] bone to world, columns contiguous.</summary>
        public float[] BindMatrices { get; set; }

        /// <summary>Null or [BoneNames.Count] DCLOTH_ROLE_*; NONE: by the bone's name.</summary>
        public uint[] BoneRoles { get; set; }

        /// <summary>Null or [n, 3] points of the skin in the world.</summary>
        public float[] BodyPositions { get; set; }

        /// <summary>[n, BodyInfluences] indices of bones.</summary>
        public uint[] BodyBones { get; set; }

        /// <summary>[n, BodyInfluences], 0 or more.</summary>
        public float[] BodyWeights { get; set; }

        /// <summary>1 to 16.</summary>
        public int BodyInfluences { get; set; } = 4;

        /// <summary>Null or [t, 3]; without them the points must lie close to each other.</summary>
        public uint[] BodyTriangles { get; set; }

        internal int BodyCount => BodyPositions == null ? 0 : BodyPositions.Length / 3;

        /// <summary>Throws ClothException where a length is not what the others ask for: the engine reads by
        /// counts.</summary>
        internal void Check(string model)
        {
            if (BoneNames == null || BindMatrices == null)
                throw new ArgumentException("a character has BoneNames and BindMatrices");
            CheckLength(model, nameof(BindMatrices), BindMatrices, 16 * BoneNames.Count);
            if (BoneRoles != null) CheckLength(model, nameof(BoneRoles), BoneRoles, BoneNames.Count);
            CheckLength(model, nameof(BodyPositions), BodyPositions, 3 * BodyCount);
            CheckLength(model, nameof(BodyBones), BodyBones, BodyInfluences * BodyCount);
            CheckLength(model, nameof(BodyWeights), BodyWeights, BodyInfluences * BodyCount);
            if (BodyTriangles == null) return;
            CheckLength(model, nameof(BodyTriangles), BodyTriangles, BodyTriangles.Length / 3 * 3);
        }

        private static void CheckLength(string model, string what, Array array, int allowed)
        {
            int found = array == null ? 0 : array.Length;
            if (found == allowed) return;
            throw new ClothException(ClothStatus.Argument, ulong.MaxValue,
                                     model + ": " + what + " has " + found + " elements; allowed: " + allowed);
        }
    }
}
