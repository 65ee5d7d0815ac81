using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using System.Text;

namespace DCloth
{
    internal static unsafe class Utf8
    {
        /// <summary>A terminated text of the engine; empty for null.</summary>
        public static string Text(byte* terminated)
        {
            if (terminated == null) return "";
            int length = 0;
            while (terminated[length] != 0) ++length;
            return Encoding.UTF8.GetString(terminated, length);
        }

        /// <summary>An array of pointers to terminated texts, then the texts, in one block.</summary>
        public static AlignedMemory Table(IReadOnlyList<string> texts)
        {
            long size = (long)texts.Count * sizeof(byte*);
            foreach (string text in texts) size += Encoding.UTF8.GetByteCount(text) + 1;
            var memory = new AlignedMemory(size);
            byte* place = memory.Start + (long)texts.Count * sizeof(byte*);
            for (int i = 0; i < texts.Count; ++i)
            {
                byte[] bytes = Encoding.UTF8.GetBytes(texts[i]);
                ((byte**)memory.Start)[i] = place;
                Marshal.Copy(bytes, 0, (IntPtr)place, bytes.Length);
                place += bytes.Length + 1; // the block is zeroed
            }
            return memory;
        }
    }
}
