using System;
using System.Globalization;
using System.Linq;
using System.Text;
using System.Text.RegularExpressions;

namespace DCloth.Samples
{
    /// <summary>Recorded joint matrices: the tensor joint_matrices [frames, joints, 4, 4] of a sequence in safetensors,
    /// rows contiguous, right-handed. Knows as much of the format as sequences of models/ need.</summary>
    public sealed class PoseSequence
    {
        private readonly float[] matrices;

        /// <summary>Errors: FormatException.</summary>
        public PoseSequence(byte[] file)
        {
            if (file.Length < 8) throw new FormatException("not a safetensors file: " + file.Length + " bytes");
            ulong size = BitConverter.ToUInt64(file, 0);
            if (size > (ulong)file.Length - 8)
                throw new FormatException("not a safetensors file: a header of " + size + " bytes");
            string header = Encoding.UTF8.GetString(file, 8, (int)size);
            string names = Find(header, "\"joint_names\"\\s*:\\s*\"((?:\\\\.|[^\"\\\\])*)\"");
            JointNames = Regex.Matches(names.Replace("\\\"", "\""), "\"([^\"]*)\"").Cast<Match>()
                             .Select(m => m.Groups[1].Value).ToArray();
            FramesPerSecond = float.Parse(Find(header, "\"fps\"\\s*:\\s*\"([^\"]*)\""), CultureInfo.InvariantCulture);
            string entry = Find(header, "\"joint_matrices\"\\s*:\\s*\\{([^}]*)\\}");
            int begin = 8 + (int)size + int.Parse(Find(entry, "\"data_offsets\"\\s*:\\s*\\[\\s*(\\d+)"));
            FrameCount = int.Parse(Find(entry, "\"shape\"\\s*:\\s*\\[\\s*(\\d+)"));
            long bytes = 4L * 16 * FrameCount * JointNames.Length;
            if (!entry.Contains("\"F32\"") || begin + bytes > file.Length)
                throw new FormatException("joint_matrices: F32 of " + FrameCount + " frames expected: " + entry);
            matrices = new float[bytes / 4];
            Buffer.BlockCopy(file, begin, matrices, 0, (int)bytes);
        }

        public string[] JointNames { get; }
        public int FrameCount { get; }
        public float FramesPerSecond { get; }

        /// <summary>Element of a joint's matrix, as it would be in Unity: x turned round, in the joints' own axes
        /// too.</summary>
        public float UnityElement(int frame, int joint, int row, int column)
        {
            float value = matrices[16 * (frame * JointNames.Length + joint) + 4 * row + column];
            return (row == 0) != (column == 0) ? -value : value;
        }

        private static string Find(string text, string pattern)
        {
            Match match = Regex.Match(text, pattern);
            if (!match.Success) throw new FormatException("the header lacks " + pattern);
            return match.Groups[1].Value;
        }
    }
}
