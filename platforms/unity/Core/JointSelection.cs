using System;
using System.Collections.Generic;

namespace DCloth
{
    /// <summary>Which bones of a host's skeleton a model reads, so that the others' matrices are never asked
    /// for.</summary>
    public static class JointSelection
    {
        /// <summary>Binds `cloth` to the bones it needs and returns their indices: matrix i of a pose is that of bone
        /// result[i]. Of equal names the first counts. Errors: Joints, with the names that are missing.</summary>
        public static int[] Bind(ClothInstance cloth, IReadOnlyList<string> boneNames, string prefix = "")
        {
            if (boneNames == null) throw new ArgumentNullException(nameof(boneNames));
            var wanted = new HashSet<string>(cloth.Model.JointNames);
            var indices = new List<int>();
            var names = new List<string>();
            for (int i = 0; i < boneNames.Count; ++i)
            {
                string name = WithoutPrefix(boneNames[i], prefix);
                if (!wanted.Remove(name)) continue;
                indices.Add(i);
                names.Add(name);
            }
            cloth.BindJoints(names);
            return indices.ToArray();
        }

        private static string WithoutPrefix(string name, string prefix)
        {
            if (string.IsNullOrEmpty(name) || string.IsNullOrEmpty(prefix)) return name ?? "";
            return name.StartsWith(prefix, StringComparison.Ordinal) ? name.Substring(prefix.Length) : name;
        }
    }
}
