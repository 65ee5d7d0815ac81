using System;
using System.Diagnostics;
using System.Runtime.InteropServices;

namespace DCloth
{
    /// <summary>Ahead-of-time compilers build a native entry for methods that carry an attribute of this
    /// name.</summary>
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
            Type = type;
        }

        public Type Type { get; }
    }

    /// <summary>Time per step (DCLOTH_STEP_*), for ClothInstance.Update and its halves. Costs two calls into C# a
    /// step.</summary>
    public sealed unsafe class ClothTimer : IDisposable
    {
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate ulong Clock(void* context);

        private static readonly Clock Now = Ticks; // kept: the engine holds only its address
        private readonly AlignedMemory memory = new AlignedMemory(sizeof(dcloth_timer));

        public ClothTimer()
        {
            Handle->struct_size = (uint)sizeof(dcloth_timer);
            Handle->now = Marshal.GetFunctionPointerForDelegate(Now);
        }

        public dcloth_timer* Handle
        {
            get
            {
                if (memory.Start == null) throw new ObjectDisposedException(nameof(ClothTimer));
                return (dcloth_timer*)memory.Start;
            }
        }

        /// <summary>Since Clear, of all updates the timer was given to. `step` is one of DCLOTH_STEP_*.</summary>
        public double Milliseconds(int step)
        {
            if (step < 0 || step >= Native.DCLOTH_STEP_COUNT) throw new ArgumentOutOfRangeException(nameof(step));
            return 1e3 * Handle->elapsed[step] / Stopwatch.Frequency;
        }

        public void Clear()
        {
            for (int step = 0; step < Native.DCLOTH_STEP_COUNT; ++step) Handle->elapsed[step] = 0;
        }

        public void Dispose()
        {
            memory.Dispose();
        }

        [MonoPInvokeCallback(typeof(Clock))]
        private static ulong Ticks(void* context)
        {
            return (ulong)Stopwatch.GetTimestamp();
        }
    }
}
